package colonnade.memory

import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.RecordFormats
import colonnade.{Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

/** Each line that a column asks for is announced on its bus, with its records; it is read from DRAM once, and again
  * only when it is not held.
  */
class SharedCacheSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "SharedCache"

  for ((columns, sets, ways, extraSlices) <- Seq((1, 1, 1, false), (6, 2, 2, false), (3, 1, 5, false), (6, 2, 2, true)))
    it should s"serve $columns columns from $sets sets of $ways ways, extra slices $extraSlices" in {
      val cached = TestConfigs.withCache(columns = columns, sets = sets, ways = ways, misses = 3, parity = ways == 2)
      val config = if (extraSlices) TestConfigs.withExtraSlices(cached) else cached
      test(new SharedCache(config)).withAnnotations(Simulation.verilator) { dut =>
        val bench = new Bench(dut, config, new Random(columns))
        bench.run(150)

        // Reads that fail are not kept
        bench.failing = Set(1, 3)
        bench.run(100)
        assert(bench.failed > 5)
        bench.failing = Set()
        bench.run(60)

        // A line is read with its buddy; as many pairs as the cache holds are read once
        bench.invalidate()
        val cache = config.columnBvhMemory.cache.get
        val held  = cache.sharedSets(config.columnBvhMemory.banks) * cache.sharedWays / 2 * 2
        val seen  = bench.forget()
        var reads = bench.reads
        bench.run(1, range = 1)
        assert(bench.reads - reads == 2)
        bench.invalidate()
        reads = bench.reads
        bench.run(40 + 20 * held, range = held.max(1))
        if (held > 0) assert(bench.reads - reads == held && seen > held)
      }
    }

  /** Columns in front of the cache, and reads of random latency behind it. */
  private class Bench(dut: SharedCache, config: ColonnadeConfig, random: Random) {
    private val bits     = new RecordFormats(config).recordBits
    private val lines    = 1 << Lines.lineBits(config)
    private val contents = Seq.fill(lines, Lines.records)(BigInt(bits, random))
    private val inFlight = mutable.Queue.empty[(Int, Int, Boolean)] // line, due, whether it fails
    private val zeros    = mutable.Set.empty[Int]                   // lines whose last read has failed
    private val maxReads = config.columnBvhMemory.cache.get.sharedMisses / config.columnBvhMemory.banks
    private var now      = 0

    /** Lines whose reads fail; reads, and those that have failed. */
    var failing       = Set.empty[Int]
    var reads, failed = 0
    val columns       = new FakeColumns(
      config,
      dut.io.requests,
      dut.io.lines,
      (line, word) => Set(if (zeros(line)) BigInt(0) else contents(line)(word)),
      random
    )

    dut.clock.setTimeout(0)

    def invalidate(): Unit = {
      dut.io.invalidate.poke(true)
      dut.clock.step()
      dut.io.invalidate.poke(false)
    }

    /** Forgets which lines were requested; returns their number. */
    def forget(): Int = {
      val count = columns.issued.size
      columns.issued.clear()
      count
    }

    def run(requests: Int, range: Int = lines): Unit = {
      var left = requests
      while (left > 0 || columns.isWaiting) left -= step(left, range)
      for (_ <- 0 until 100) step(0, range)
      dut.io.isIdle.expect(true)
      assert(inFlight.isEmpty)
    }

    private def step(most: Int, range: Int): Int = {
      val issued = columns.offer(most, range)
      give()
      read()
      columns.take()
      dut.clock.step()
      now += 1
      issued
    }

    private def read(): Unit = {
      val accepts = random.nextInt(3) > 0
      dut.io.reads.ready.poke(accepts)
      if (accepts && dut.io.reads.valid.peekBoolean()) {
        val line = dut.io.reads.bits.peekInt().toInt
        assert(!inFlight.exists(_._1 == line) && inFlight.size < maxReads, s"line $line is read beside $inFlight")
        inFlight.enqueue((line, now + 1 + random.nextInt(40), failing(line)))
        reads += 1
      }
    }

    /** The oldest line, which stays until it is taken. */
    private def give(): Unit = {
      val oldest = inFlight.headOption.filter(_._2 <= now)
      dut.io.data.valid.poke(oldest.nonEmpty)
      for ((line, _, fails) <- oldest) {
        if (fails) zeros += line else zeros -= line
        dut.io.data.bits.isError.poke(fails)
        for ((port, content) <- dut.io.data.bits.records.zip(contents(line))) {
          val parity = if (Lines.hasParity(config)) BigInt(content.bitCount % 2) else BigInt(0)
          port.poke(content + (parity << bits))
        }
        if (dut.io.data.ready.peekBoolean()) {
          inFlight.dequeue()
          if (fails) failed += 1
        }
      }
    }
  }
}
