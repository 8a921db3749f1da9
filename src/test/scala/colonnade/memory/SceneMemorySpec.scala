package colonnade.memory

import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.{Always, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

/** Every line that a column requests is announced to it, with the records of the scene in DRAM. */
class SceneMemorySpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "SceneMemory"

  for {
    (columns, banks, sets, ways, bus) <-
      Seq((1, 1, 1, 1, 64), (3, 4, 1, 4, 16), (6, 2, 4, 1, 128))
    extraSlices <- if (columns == 3) Seq(false, true) else Seq(false)
  }
    it should s"serve $columns columns from $banks banks of $sets sets of $ways ways over a bus of $bus bytes, extra slices $extraSlices" taggedAs
      Always.unless(columns == 3 && !extraSlices) in {
        val cached =
          TestConfigs.withCache(
            columns = columns,
            banks = banks,
            sets = sets,
            ways = ways,
            bus = bus,
            parity = columns > 3
          )
        val config = if (extraSlices) TestConfigs.withExtraSlices(cached) else cached
        test(new SceneMemory(config)).withAnnotations(Simulation.verilator) { dut =>
          val bench = new Bench(dut, config, new Random(columns))
          bench.run(requests = 120)
          val warm = bench.dram.reads
          bench.run(requests = 60, range = 1)
          val held = bench.dram.reads
          held - warm should be <= 2 * banks // held after their first reads
          bench.invalidate()
          bench.run(requests = 40, range = 1)
          bench.dram.reads should be > held
        }
      }

  for ((columns, banks) <- Seq((1, 1), (3, 2), (6, 4)))
    it should s"pass lines to $columns columns from $banks banks without a shared cache" taggedAs Always.unless(
      columns == 1
    ) in {
      val config =
        TestConfigs.withCache(columns = columns, banks = banks, bus = 4, parity = columns > 3, shared = false)
      test(new SceneMemory(config)).withAnnotations(Simulation.verilator) { dut =>
        val bench = new Bench(dut, config, new Random(columns))
        bench.run(requests = 120)
        bench.dram.reads should be <= 120
        bench.fail()
        bench.run(requests = 60)
      }
    }

  it should "announce zeros for a line whose read fails, report it, and read it again" in {
    val config = TestConfigs.withCache(columns = 2, banks = 4)
    test(new SceneMemory(config)).withAnnotations(Simulation.verilator) { dut =>
      val bench = new Bench(dut, config, new Random(1))
      bench.fail()
      bench.run(requests = 100)
    }
  }

  private class Bench(dut: SceneMemory, config: ColonnadeConfig, random: Random) {
    private val lines = 1 << Lines.lineBits(config)
    private val banks = 0 until config.columnBvhMemory.banks
    val dram          = new FakeDram(dut.io.axi, config, random, config.columnBvhMemory.cache.get.hasSharedCache)
    private var reads, errors = 0 // of the events

    /** By bank; a line whose read fails may be known from a read before. */
    private val columns = banks.map { bank =>
      def allowed(line: Int, word: Int) = {
        val record = dram.record(bank, line, word)
        if (dram.fails(bank, line)) Set(record, BigInt(0)) else Set(record)
      }
      new FakeColumns(config, dut.io.requests.map(_(bank)), dut.io.lines.map(_(bank)), allowed, random)
    }

    dut.clock.setTimeout(0)
    dut.io.page.poke(dram.page)

    def run(requests: Int, range: Int = lines): Unit = {
      var left = requests
      while (left > 0 || columns.exists(_.isWaiting)) left -= step(left, range)
      for (_ <- 1 to 300) step(0, range)
      dut.io.isIdle.expect(true)
      reads shouldBe dram.reads
    }

    /** Lines of each bank fail; each failure is reported. */
    def fail(): Unit = {
      dram.failing = Set(0, 1)
      for (bank <- banks) {
        val before = dram.failed
        invalidate()
        dram.failingBanks = Set(bank)
        run(requests = 20 * banks.size)
        dram.failed should be > before
        errors shouldBe dram.failed
      }
      dram.failing = Set()
    }

    def invalidate(): Unit = {
      dut.io.invalidate.poke(true)
      dut.clock.step()
      dut.io.invalidate.poke(false)
    }

    private def step(most: Int, range: Int): Int = {
      val issued = columns.foldLeft(0)((issued, bank) => issued + bank.offer(most - issued, range))
      dram.cycle()
      columns.foreach(_.take())
      reads += dut.io.events.dramReads.peekInt().toInt
      if (dut.io.events.error.peekBoolean()) errors += 1
      dut.clock.step()
      issued
    }
  }
}
