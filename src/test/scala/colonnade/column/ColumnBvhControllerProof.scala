package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, Mux1H, PopCount}
import colonnade.config.ColonnadeConfig
import colonnade.formats.Banks

/** Drives rows that request, withdraw and change addresses at any time, and banks that stall and respond at any time, in
  * order. It observes one read of each bank, any that is accepted while the bank's bit of `observed` is set, up to its
  * broadcast. With snooping, a row waits only for a record that is being read.
  */
class ColumnBvhControllerProof(config: ColonnadeConfig) extends Module {
  private val rows     = config.recordRequesters
  private val banks    = config.columnBvhMemory.banks
  private val capacity = config.columnBvhMemory.readLatency + 1

  private val dut      = Module(new ColumnBvhController(config))
  private val requests = dut.io.requests

  val requestsValid = IO(Input(UInt(rows.W)))
  val addresses     = IO(Input(Vec(rows, chiselTypeOf(requests.head.bits.address))))
  val ready         = IO(Input(UInt(banks.W)))
  val responds      = IO(Input(UInt(banks.W)))
  val data          = IO(Input(UInt(banks.W))) // one bit distinguishes the records
  val observed      = IO(Input(UInt(banks.W)))

  requests.zipWithIndex.foreach { case (request, row) =>
    request.valid        := requestsValid(row)
    request.bits.address := addresses(row)
  }

  private val bankModels = Seq.tabulate(banks)(new BankModel(_))
  assert(dut.io.isIdle === bankModels.map(_.isIdle).reduce(_ && _), "idle when nothing is in flight")
  assert(dut.io.events.recordReads === PopCount(requests.map(_.fire)), "every read is counted")

  cover(dut.io.broadcasts.map(_.valid).reduce(_ && _), "all banks broadcast a record")
  cover(bankModels.map(_.held === capacity.U).reduce(_ && _), "all banks are full")
  cover(bankModels.map(_.arrives).reduce(_ && _), "reads of all banks arrive")
  cover(bankModels.map(_.waitedLongest).reduce(_ || _), "a row is passed over by all others, and then accepted")

  /** A model of a bank's memory, and the expected behaviour of its part of the controller. */
  private class BankModel(bank: Int) {
    private val memory    = dut.io.memory(bank)
    private val broadcast = dut.io.broadcasts(bank)
    val held              = RegInit(0.U(log2Ceil(capacity + 1).W))
    private val underWay  = Reg(Vec(capacity, chiselTypeOf(addresses.head))) // the newest one first
    private val requested = requests.map { request =>
      val isRead = underWay.zipWithIndex.map { case (read, index) => held > index.U && read === request.bits.address }
      val waits  = config.columnBvhMemory.snooping.B && isRead.reduce(_ || _)
      request.valid && Banks.isIn(config, request.bits.address, bank) && !waits
    }
    private val fires   = requests.zip(requested).map { case (request, isRequested) => request.ready && isRequested }
    private val accepts = fires.reduce(_ || _)
    private val address = Mux1H(fires, addresses)

    // The memory
    private val response = responds(bank) && held =/= 0.U
    held := held + accepts - response
    when(accepts) { underWay := VecInit(address +: underWay.init) }
    memory.request.ready        := ready(bank)
    memory.response.valid       := response
    memory.response.bits.record := data(bank)

    assert(PopCount(fires) <= 1.U, "one row at a time")
    assert(accepts === memory.request.fire, "a read for each request")
    assert(
      accepts === (requested.reduce(_ || _) && ready(bank) && held =/= capacity.U),
      "no read is delayed without a cause"
    )
    assert(!accepts || memory.request.bits === Banks.addressIn(config, address), "the right address in the bank")
    assert(broadcast.valid === RegNext(response, false.B), "a broadcast for each response")
    assert(
      !broadcast.valid || broadcast.bits.record === RegNext(memory.response.bits.record),
      "the record that was read"
    )
    val isIdle = held === 0.U && !broadcast.valid

    // Accepted requests of others while a row keeps requesting
    private val passedOver = requested.zip(fires).map { case (isRequested, fire) =>
      val times = RegInit(0.U(log2Ceil(rows + 1).W))
      times := Mux(isRequested && !fire, times + accepts, 0.U)
      assert(times < rows.U, "a row waits once for each other row at most")
      times
    }
    val waitedLongest =
      passedOver.zip(fires).map { case (times, fire) => fire && times === (rows - 1).U }.reduce(_ || _)

    // The observed read, and the number of reads before it
    private val isObserving     = RegInit(false.B)
    private val ahead           = Reg(chiselTypeOf(held))
    private val observedAddress = Reg(chiselTypeOf(address))
    private val row             = Reg(chiselTypeOf(broadcast.bits.row))
    val arrives                 = isObserving && response && ahead === 0.U
    when(observed(bank) && accepts && !isObserving) {
      isObserving     := true.B
      ahead           := held - response
      observedAddress := address
      row             := Mux1H(fires, (0 until rows).map(_.U))
    }.elsewhen(isObserving && response) {
      ahead := ahead - 1.U
      when(arrives) { isObserving := false.B }
    }
    when(RegNext(arrives, false.B)) {
      assert(broadcast.bits.address === RegNext(observedAddress), "the requested record")
      assert(broadcast.bits.row === RegNext(row), "the requesting row")
    }
  }
}
