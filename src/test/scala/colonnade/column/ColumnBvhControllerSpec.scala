package colonnade.column

import chisel3._
import chisel3.util.{Decoupled, Valid}
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Load, RecordBroadcast, RecordFormats, RecordRequest}
import colonnade.memory.ColumnBvhMemory
import colonnade.{Proofs, Simulation, TestConfigs}
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
