package colonnade.memory

import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RecordFormats, SceneInDram}
import colonnade.{Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

class DramReaderSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "DramReader"

  private def config(banks: Int, bus: Int) = TestConfigs.withCache(banks = banks, bus = bus, parity = banks == 2)

  for ((banks, bus) <- Seq((1, 128), (2, 32), (4, 8)))
    it should s"give each of $banks banks its lines in order, and say which reads failed, over $bus bytes" in {
      val configuration = config(banks, bus)
      test(new DramReader(configuration)).withAnnotations(Simulation.verilator) { dut =>
        val random = new Random(bus)
        val reads  = new Reads(dut, configuration, random)
        reads.dram.failing = Set(1, 4)
        while (reads.lines < 40) reads.step(asks = reads.issued < 40, isTaken = random.nextInt(3) > 0)
        assert(reads.failed > 3 && reads.failed < 30)
      }
    }

  for (bus <- Seq(32, 4)) {
    val configuration = config(banks = 1, bus)
    val held          = if (DramReader.beats(configuration) > DramReader.maxBeats) 1 else 2
    it should s"hold lines of a bank that wait, over $bus bytes: $held" in
      test(new DramReader(configuration)).withAnnotations(Simulation.verilator) { dut =>
        val reads = new Reads(dut, configuration, new Random(5))
        for (_ <- 0 until 400) reads.step(asks = reads.issued < 5, isTaken = false)
        assert(reads.dram.taken == held * DramReader.beats(configuration))
        while (reads.lines < 5) reads.step(asks = false, isTaken = true)
      }
  }

  /** Banks that ask for lines at random and check what comes. */
  private class Reads(dut: DramReader, config: ColonnadeConfig, random: Random) {
    private val banks    = config.columnBvhMemory.banks
    private val expected = Seq.fill(banks)(mutable.Queue.empty[Int])
    private val offers   = Array.fill(banks)(Option.empty[Int])
    private var idle     = 0
    val dram             = new FakeDram(dut.io.axi, config, random, isShared = false)

    /** Lines that were requested, lines that have come, and those whose read failed. */
    var issued, lines, failed = 0

    dut.clock.setTimeout(0)
    dut.io.base.poke(dram.page << SceneInDram.pageLog)

    def step(asks: Boolean, isTaken: => Boolean): Unit = {
      for ((port, bank) <- dut.io.reads.zipWithIndex) {
        if (asks && offers(bank).isEmpty && random.nextInt(8) == 0) {
          offers(bank) = Some(random.nextInt(if (random.nextBoolean()) 6 else 1 << Lines.lineBits(config)))
          issued += 1
        }
        port.valid.poke(offers(bank).nonEmpty)
        offers(bank).foreach(port.bits.poke(_))
      }
      dut.io.lines.foreach(_.ready.poke(isTaken))
      dram.cycle()
      for ((port, bank) <- dut.io.reads.zipWithIndex; line <- offers(bank) if port.ready.peekBoolean()) {
        expected(bank).enqueue(line)
        offers(bank) = None
      }
      idle += 1
      for ((port, bank) <- dut.io.lines.zipWithIndex if port.valid.peekBoolean()) {
        val line = expected(bank).head
        port.bits.isError.expect(dram.failing(line), s"line $line of bank $bank")
        for ((record, word) <- port.bits.records.zipWithIndex) {
          val content = dram.record(bank, line, word)
          val parity  = if (Lines.hasParity(config)) BigInt(content.bitCount % 2) else BigInt(0)
          record.expect(
            content + (parity << new RecordFormats(config).recordBits),
            s"word $word of $line of bank $bank"
          )
        }
        if (port.ready.peekBoolean()) {
          expected(bank).dequeue()
          lines += 1
          if (dram.failing(line)) failed += 1
          idle = 0
        }
      }
      assert(idle < 1000, s"nothing comes after $lines lines")
      dut.clock.step()
    }
  }
}
