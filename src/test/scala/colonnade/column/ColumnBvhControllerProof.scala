package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, Mux1H, PopCount}
import colonnade.config.ColonnadeConfig

/** Rows that ask, withdraw and change their minds at any time; banks that stall, and answer at any time, though in
  * order. Follows one read of each bank, any that is accepted while the bank's bit of `marks` is set, to its broadcast.
  * With snooping a row has to wait for a record that is being read, and for nothing else.
  */
class ColumnBvhControllerProof(config: ColonnadeConfig) extends Module {
  private val rows     = config.array.rows
  private val banks    = config.columnBvhMemory.banks
  private val capacity = config.columnBvhMemory.readLatency + 1

  private val dut      = Module(new ColumnBvhController(config))
  private val requests = dut.io.requests

  val asks      = IO(Input(UInt(rows.W)))
  val addresses = IO(Input(Vec(rows, chiselTypeOf(requests.head.bits.address))))
  val ready     = IO(Input(UInt(banks.W)))
  val answers   = IO(Input(UInt(banks.W)))
  val data      = IO(Input(UInt(banks.W))) // a bit tells one bank's records from another's, and its own apart
  val marks     = IO(Input(UInt(banks.W)))

  requests.zipWithIndex.foreach { case (request, row) =>
    request.valid        := asks(row)
    request.bits.address := addresses(row)
  }

  private val sides = Seq.tabulate(banks)(new Side(_))
  assert(dut.io.isIdle === sides.map(_.isIdle).reduce(_ && _), "idle when nothing is in flight")
  assert(dut.io.events.recordReads === PopCount(requests.map(_.fire)), "every read is counted")

  cover(dut.io.broadcasts.map(_.valid).reduce(_ && _), "all banks show a record")
  cover(sides.map(_.held === capacity.U).reduce(_ && _), "all banks are full")
  cover(sides.map(_.arrives).reduce(_ && _), "reads of all banks arrive")
  cover(sides.map(_.waitedLongest).reduce(_ || _), "a row is passed over by all others, and then accepted")

  /** A bank's memory, and what is expected of its part of the controller. */
  private class Side(bank: Int) {
    private val memory    = dut.io.memory(bank)
    private val broadcast = dut.io.broadcasts(bank)
    val held              = RegInit(0.U(log2Ceil(capacity + 1).W))
    private val underWay  = Reg(Vec(capacity, chiselTypeOf(addresses.head))) // the latest one first
    private val asked     = requests.map { request =>
      val isRead = underWay.zipWithIndex.map { case (read, place) => held > place.U && read === request.bits.address }
      val waits  = config.columnBvhMemory.snooping.B && isRead.reduce(_ || _)
      request.valid && Banks.isIn(config, request.bits.address, bank) && !waits
    }
    private val fires   = requests.zip(asked).map { case (request, isAsked) => request.ready && isAsked }
    private val accepts = fires.reduce(_ || _)
    private val address = Mux1H(fires, addresses)

    // The memory
    private val answer = answers(bank) && held =/= 0.U
    held := held + accepts - answer
    when(accepts) { underWay := VecInit(address +: underWay.init) }
    memory.request.ready  := ready(bank)
    memory.response.valid := answer
    memory.response.bits  := data(bank)

    assert(PopCount(fires) <= 1.U, "one row at a time")
    assert(accepts === memory.request.fire, "a read for each request")
    assert(
      accepts === (asked.reduce(_ || _) && ready(bank) && held =/= capacity.U),
      "no read is put off without a cause"
    )
    assert(!accepts || memory.request.bits === Banks.addressIn(config, address), "the right place in the bank")
    assert(broadcast.valid === RegNext(answer, false.B), "a broadcast for each answer")
    assert(!broadcast.valid || broadcast.bits.record === RegNext(memory.response.bits), "the record that was read")
    val isIdle = held === 0.U && !broadcast.valid

    // How often others are accepted while a row keeps asking
    private val passedOver = asked.zip(fires).map { case (isAsked, fire) =>
      val times = RegInit(0.U(log2Ceil(rows + 1).W))
      times := Mux(isAsked && !fire, times + accepts, 0.U)
      assert(times < rows.U, "nobody waits for more than the others")
      times
    }
    val waitedLongest =
      passedOver.zip(fires).map { case (times, fire) => fire && times === (rows - 1).U }.reduce(_ || _)

    // The read that is followed, and how many are before it
    private val follows = RegInit(false.B)
    private val ahead   = Reg(chiselTypeOf(held))
    private val wanted  = Reg(chiselTypeOf(address))
    private val row     = Reg(chiselTypeOf(broadcast.bits.row))
    val arrives         = follows && answer && ahead === 0.U
    when(marks(bank) && accepts && !follows) {
      follows := true.B
      ahead   := held - answer
      wanted  := address
      row     := Mux1H(fires, (0 until rows).map(_.U))
    }.elsewhen(follows && answer) {
      ahead := ahead - 1.U
      when(arrives) { follows := false.B }
    }
    when(RegNext(arrives, false.B)) {
      assert(broadcast.bits.address === RegNext(wanted), "the record that was asked for")
      assert(broadcast.bits.row === RegNext(row), "for the row that asked")
    }
  }
}
