package colonnade.column

import chisel3._
import chisel3.util.Mux1H
import colonnade.config.ColonnadeConfig

/** Rows that ask, withdraw and change their minds at any time; a bank that stalls and answers at any time. Follows one
  * read, any that is accepted while `marks` is set, to its broadcast.
  */
class BankReaderProof(config: ColonnadeConfig) extends Module {
  private val rows     = config.array.rows
  private val capacity = config.columnBvhMemory.readLatency + 1

  private val dut = Module(new BankReader(config))

  val asks      = IO(Input(UInt(rows.W)))
  val addresses = IO(Input(Vec(rows, Bool()))) // a bit and the row tell records apart
  val ready     = IO(Input(Bool()))
  val answers   = IO(Input(Bool()))
  val marks     = IO(Input(Bool()))

  private val wants = addresses.zipWithIndex.map { case (bit, row) => row.U(1.W) ## bit }
  dut.io.requests.zipWithIndex.foreach { case (request, row) =>
    request.valid        := asks(row)
    request.bits.address := wants(row)
  }
  private val fires   = dut.io.requests.map(_.fire)
  private val accepts = fires.reduce(_ || _)
  private val address = Mux1H(fires, wants)

  private val held   = RegInit(0.U(2.W))
  private val answer = answers && held =/= 0.U
  held                         := held + accepts - answer
  dut.io.memory.request.ready  := ready
  dut.io.memory.response.valid := answer
  dut.io.memory.response.bits  := 0.U

  assert(accepts === dut.io.memory.request.fire, "a read for each request")
  assert(accepts === (asks.orR && ready && held =/= capacity.U), "no read is put off without a cause")
  assert(!accepts || dut.io.memory.request.bits === address, "the right address")
  assert(dut.io.broadcast.valid === RegNext(answer, false.B), "a broadcast for each answer")
  assert(dut.io.isIdle === (held === 0.U && !dut.io.broadcast.valid), "idle when nothing is in flight")

  // The read that is followed, and how many are before it
  private val follows = RegInit(false.B)
  private val ahead   = Reg(UInt(2.W))
  private val wanted  = Reg(chiselTypeOf(address))
  private val arrives = follows && answer && ahead === 0.U
  when(marks && accepts && !follows) {
    follows := true.B
    ahead   := held - answer
    wanted  := address
  }.elsewhen(follows && answer) {
    ahead := ahead - 1.U
    when(arrives) { follows := false.B }
  }
  when(RegNext(arrives, false.B)) {
    val asked = RegNext(wanted)
    assert(dut.io.broadcast.bits.address === asked, "the record that was asked for")
    assert(dut.io.broadcast.bits.row === asked(1), "for the row that asked")
  }
}
