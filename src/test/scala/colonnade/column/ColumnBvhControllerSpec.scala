package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Mux1H, PopCount, Valid}
import chiseltest._
import colonnade.{Proofs, Simulation, TestConfigs}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Banks, Load, RecordBroadcast, RecordFormats, RecordRequest}
import colonnade.memory.ColumnBvhMemory
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** The controller with its memory. */
class ControllerAndMemory(config: ColonnadeConfig) extends Module {
  val requests   = IO(Vec(config.recordRequesters, Flipped(Decoupled(new RecordRequest(config)))))
  val broadcasts = IO(Output(Vec(config.columnBvhMemory.banks, Valid(new RecordBroadcast(config)))))
  val load       = IO(Flipped(Valid(new Load(config))))
  val reads      = IO(Output(UInt(8.W)))
  val conflicts  = IO(Output(UInt(8.W)))
  val isIdle     = IO(Output(Bool()))

  private val controller = Module(new ColumnBvhController(config))
  private val memory     = Module(new ColumnBvhMemory(config))
  controller.io.requests <> requests
  memory.io.banks <> controller.io.memory
  memory.io.load := load
  broadcasts     := controller.io.broadcasts
  reads          := controller.io.events.recordReads
  conflicts      := controller.io.events.bankConflicts
  isIdle         := controller.io.isIdle
}

class ColumnBvhControllerSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "ColumnBvhController"

  /** With `rows` requesters: the path unit is one of them. */
  private def config(rows: Int, banks: Int, latency: Int, depth: Int = 61): ColonnadeConfig = TestConfigs.tiny.copy(
    array = TestConfigs.tiny.array.copy(rows = rows - 1),
    columnBvhMemory = TestConfigs.tiny.columnBvhMemory.copy(depth = depth, banks = banks, readLatency = latency)
  )

  for (snooping <- Seq(true, false))
    it should s"neither lose nor duplicate reads, and starve no row, whenever two banks respond, snooping $snooping" in {
      val shape = config(rows = 3, banks = 2, latency = 1, depth = 16)
      prove(
        new ColumnBvhControllerProof(shape.copy(columnBvhMemory = shape.columnBvhMemory.copy(snooping = snooping)))
      )
    }

  private def load(dut: ControllerAndMemory, records: Seq[BigInt]): Unit = {
    dut.load.valid.poke(true)
    for ((record, address) <- records.zipWithIndex; target <- Seq(0, 1)) {
      dut.load.bits.target.poke(target)
      dut.load.bits.address.poke(address)
      dut.load.bits.record.poke((if (target == 0) record else record ^ 1).U(dut.load.bits.record.getWidth.W))
      dut.clock.step()
    }
    dut.load.valid.poke(false)
  }

  for ((rows, banks, latency) <- Seq((2, 1, 1), (10, 2, 3), (4, 4, 6))) {
    it should s"serve $rows rows from $banks banks of latency $latency, and count" in {
      val configuration = config(rows, banks, latency)
      val depth         = configuration.columnBvhMemory.depth
      val random        = new Random(rows)
      val records       = Seq.fill(depth)(BigInt(new RecordFormats(configuration).recordBits, random))
      test(new ControllerAndMemory(configuration)).withAnnotations(Simulation.verilator) { dut =>
        dut.clock.setTimeout(0)
        load(dut, records)
        val wants    = Array.fill(rows)(Option.empty[Int])
        var due      = Map.empty[Int, Seq[(Int, Int)]] // row and address by cycle
        var accepted = 0
        for (cycle <- 0 until 300) {
          // Rows request, and sometimes withdraw.
          for (row <- 0 until rows) {
            if (cycle >= 260 || random.nextInt(12) == 0) wants(row) = None
            else if (wants(row).isEmpty && random.nextInt(3) == 0) wants(row) = Some(random.nextInt(depth))
            dut.requests(row).valid.poke(wants(row).nonEmpty)
            wants(row).foreach(dut.requests(row).bits.address.poke(_))
          }
          dut.isIdle.expect(!due.exists { case (at, reads) => at >= cycle && reads.nonEmpty })
          // An accepted request is broadcast after the latency.
          val takes = (0 until rows).filter(row => wants(row).nonEmpty && dut.requests(row).ready.peekBoolean())
          assert(takes.map(row => wants(row).get % banks).distinct.size == takes.size, "one a bank")
          val isRead = (1 to latency).flatMap(later => due.getOrElse(cycle + later, Nil)).map(_._2).toSet
          val asked  = wants.flatten.filterNot(isRead).groupBy(_ % banks)
          assert(takes.size == asked.size, "each bank that is asked accepts")
          dut.reads.expect(takes.size)
          dut.conflicts.expect(asked.values.map(_.length - 1).sum)
          due += (cycle + latency + 1) -> takes.map(row => (row, wants(row).get))
          accepted += takes.size
          val now = due.getOrElse(cycle, Nil)
          for ((broadcast, bank) <- dut.broadcasts.zipWithIndex) {
            val expected = now.find(_._2 % banks == bank)
            broadcast.valid.expect(expected.nonEmpty)
            expected.foreach { case (row, address) =>
              broadcast.bits.row.expect(row)
              broadcast.bits.address.expect(address)
              broadcast.bits.record.expect(records(address).U)
            }
          }
          takes.foreach(wants(_) = None)
          dut.clock.step()
        }
        dut.isIdle.expect(true)
        assert(accepted > 50)
      }
    }
  }
}

/** Drives rows that request, withdraw and change addresses at any time, and banks that stall and respond at any time,
  * in order. It observes one read of each bank, any that is accepted while the bank's bit of `observed` is set, up to
  * its broadcast. With snooping, a row waits only for a record that is being read.
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
