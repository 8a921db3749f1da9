package colonnade.column

import chisel3._
import chisel3.util.Mux1H
import colonnade.config.ColonnadeConfig
import colonnade.unit.RecordRequest

/** Rows that ask, withdraw and change their minds at any time; banks that stall and answer at any time. A scoreboard
  * for each bank holds what was accepted and not yet answered.
  */
class ColumnBvhControllerProof(config: ColonnadeConfig) extends Module {
  private val rows     = config.array.rows
  private val banks    = config.columnBvhMemory.banks
  private val capacity = config.columnBvhMemory.readLatency + 1

  private val dut = Module(new ColumnBvhController(config))

  val asks      = IO(Input(UInt(rows.W)))
  val addresses = IO(Input(Vec(rows, new RecordRequest(config))))
  val ready     = IO(Input(UInt(banks.W)))
  val answers   = IO(Input(UInt(banks.W)))
  val records   = IO(Input(Vec(banks, chiselTypeOf(dut.io.memory.head.response.bits))))

  private val requests = dut.io.requests
  for ((request, row) <- requests.zipWithIndex) {
    request.valid := asks(row)
    request.bits  := addresses(row)
  }

  for (bank <- 0 until banks) {
    val memory    = dut.io.memory(bank)
    val broadcast = dut.io.broadcasts(bank)

    // What the bank accepts
    val wanted   = requests.map(request => request.valid && Banks.isIn(config, request.bits.address, bank))
    val accepted = requests.zip(wanted).map { case (request, wants) => wants && request.ready }
    val accepts  = accepted.reduce(_ || _)
    val address  = Mux1H(accepted, requests.map(_.bits.address))
    val row      = Mux1H(accepted, (0 until rows).map(_.U(2.W)))

    // The scoreboard: the oldest first
    val held   = RegInit(0.U(2.W))
    val places = Reg(Vec(capacity + 1, chiselTypeOf(address)))
    val owners = Reg(Vec(capacity + 1, UInt(2.W)))
    val answer = answers(bank) && held =/= 0.U
    when(answer) {
      for (i <- 0 until capacity) {
        places(i) := places(i + 1)
        owners(i) := owners(i + 1)
      }
    }
    when(accepts) {
      places(held - answer) := address
      owners(held - answer) := row
    }
    held := held + accepts - answer
    assert(held <= capacity.U, "no more in flight than there is room for")

    // The memory
    memory.request.ready  := ready(bank)
    memory.response.valid := answer
    memory.response.bits  := records(bank)
    assert(memory.request.fire === accepts, "a read for each request")
    assert(!accepts || memory.request.bits === Banks.addressIn(config, address), "the right address")
    val hasRoom = held < capacity.U
    assert(accepts === (wanted.reduce(_ || _) && ready(bank) && hasRoom), "no read is put off without a cause")

    // What everybody sees
    assert(broadcast.valid === RegNext(answer, false.B), "each record once")
    when(broadcast.valid) {
      assert(broadcast.bits.address === RegNext(places(0)) && broadcast.bits.row === RegNext(owners(0)), "in order")
      assert(broadcast.bits.record === RegNext(records(bank)), "the record itself")
    }
    assert(dut.io.isIdle === false.B || (held === 0.U && !broadcast.valid), "idle means empty")

    // Nobody starves
    for (row <- 0 until rows) {
      val waited = RegInit(0.U(2.W))
      when(!wanted(row) || accepted(row)) { waited := 0.U }.elsewhen(accepts) { waited := waited + 1.U }
      assert(waited < rows.U, "nobody waits for more than the others")
    }
  }
}
