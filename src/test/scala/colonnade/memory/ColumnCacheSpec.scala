package colonnade.memory

import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Banks, RecordFormats}
import colonnade.{Always, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

/** Every request is answered after two cycles, three with an extra slice, with its record or "later"; then a fill
  * brings the record.
  */
class ColumnCacheSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "ColumnCache"

  for {
    ((banks, sets, ways, misses), i) <-
      Seq((1, 1, 1, 1), (2, 2, 2, 2), (2, 4, 1, 3), (4, 1, 4, 2), (1, 2, 3, 2)).zipWithIndex
    extraSlices <- Seq(false, true)
  }
    it should s"answer from $sets sets of $ways ways, $misses misses, as one of $banks banks, extra slices $extraSlices" taggedAs
      Always.unless(extraSlices == (i % 2 == 0)) in {
        val cached = TestConfigs.withCache(banks = banks, sets = sets, ways = ways, misses = misses, parity = sets == 4)
        val config = if (extraSlices) TestConfigs.withExtraSlices(cached) else cached
        test(new ColumnCache(config)).withAnnotations(Simulation.verilator) { dut =>
          new Surroundings(dut, config, new Random(7 * sets + ways)).run(3000)
        }
      }

  it should "answer zeros for a record whose parity is wrong, and report it" in {
    val config = TestConfigs.withCache(banks = 1, parity = true)
    val wrong  = 1
    test(new ColumnCache(config)) { dut =>
      def content(word: Int): BigInt = BigInt(3 * word + 7)
      dut.io.port.request.valid.poke(true)
      dut.io.port.request.bits.poke(0)
      dut.clock.step()
      dut.io.port.request.valid.poke(false)
      dut.clock.step(3)
      dut.io.lines.announced.valid.poke(true)
      dut.io.lines.announced.bits.poke(0)
      dut.clock.step()
      dut.io.lines.announced.valid.poke(false)
      dut.clock.step(LineBroadcast.latency - 1)
      for (word <- 0 until Lines.records) {
        val right = stored(config, content(word))
        dut.io.lines.record.poke(if (word == wrong) right.flipBit(100) else right)
        dut.io.port.fill.get.bits.record.expect(if (word == wrong) BigInt(0) else content(word))
        dut.io.error.get.expect(word == wrong + 1)
        dut.clock.step()
      }
      for (word <- 0 until Lines.records) {
        dut.io.port.request.valid.poke(true)
        dut.io.port.request.bits.poke(word)
        dut.clock.step()
        dut.io.port.request.valid.poke(false)
        dut.clock.step()
        dut.io.port.response.valid.expect(true)
        dut.io.port.response.bits.record.expect(if (word == wrong) BigInt(0) else content(word))
        dut.clock.step()
        dut.io.error.get.expect(word == wrong)
      }
    }
  }

  /** A record with its parity, if it has one. */
  private def stored(config: ColonnadeConfig, record: BigInt): BigInt =
    if (Lines.hasParity(config) && record.bitCount % 2 == 1) record.setBit(new RecordFormats(config).recordBits)
    else record

  /** The controller in front of the cache, and the shared cache behind it. */
  private class Surroundings(dut: ColumnCache, config: ColonnadeConfig, random: Random) {
    private val addresses = 1 << Banks.addressBits(config)
    private val lines     = addresses / Lines.records
    private val later     = if (config.units.extraSlices) 1 else 0
    private var now       = 0
    private val answers   = mutable.Queue.empty[(Int, Int)] // due, address
    private val owed      = mutable.Map.empty[Int, Int]     // address, since
    private val requested = mutable.Queue.empty[(Int, Int)] // due, line
    private val bus       = mutable.Map.empty[Int, Int]     // cycle, address of its record
    private var lastLine  = -100
    private var hits      = 0
    private var laters    = 0

    private def contentOf(address: Int): BigInt = BigInt(address) * 1000003 + 5

    /** Neighbouring lines, so that some are held. */
    private def anyLine(): Int = if (random.nextInt(4) == 0) random.nextInt(lines) else random.nextInt(lines.min(6))

    def run(cycles: Int): Unit = {
      dut.clock.setTimeout(0)
      while (now < cycles || owed.nonEmpty || answers.nonEmpty || requested.nonEmpty) {
        now should be < cycles + 2000
        step(asks = now < cycles)
      }
      (1 to 8).foreach(_ => step(asks = false))
      dut.io.isIdle.expect(true)
      hits should be > 5
      laters should be > 20
    }

    private def step(asks: Boolean): Unit = {
      // A line from the shared cache: one that was requested, or any other
      val isFree   = now >= lastLine + 4
      val ready    = requested.indexWhere(_._1 <= now)
      val isOwn    = isFree && ready >= 0 && random.nextInt(3) > 0
      val isOthers = isFree && !isOwn && random.nextInt(12) == 0
      dut.io.lines.announced.valid.poke(isOwn || isOthers)
      if (isOwn || isOthers) {
        val line = if (isOwn) requested.remove(ready)._2 else anyLine()
        dut.io.lines.announced.bits.poke(line)
        lastLine = now
        (0 until Lines.records).foreach(word => bus(now + 3 + word) = line * Lines.records + word)
      }
      dut.io.lines.record.poke(stored(config, bus.get(now).fold(BigInt(random.nextInt(99)))(contentOf)))
      dut.io.error.foreach(_.expect(false))

      // A read
      val isAsking = asks && random.nextInt(5) > 0
      val address  = anyLine() * Lines.records + random.nextInt(Lines.records)
      dut.io.port.request.valid.poke(isAsking)
      dut.io.port.request.bits.poke(address)
      if (isAsking && dut.io.port.request.ready.peekBoolean()) answers.enqueue((now + 2 + later, address))

      // Answers and fills
      val fill = dut.io.port.fill.get
      val due  = answers.headOption.filter(_._1 == now).map(_ => answers.dequeue()._2)
      dut.io.port.response.valid.expect(due.nonEmpty)
      for (expected <- due) {
        if (dut.io.port.response.bits.isLater.get.peekBoolean()) {
          owed.getOrElseUpdate(expected, now)
          laters += 1
        } else {
          dut.io.port.response.bits.record.expect(contentOf(expected))
          hits += 1
        }
      }
      if (fill.valid.peekBoolean()) {
        due shouldBe empty
        fill.bits.address.expect(bus(now))
        fill.bits.record.expect(contentOf(bus(now)))
        owed -= bus(now)
      }

      // Lines that the cache awaits
      val takes = random.nextInt(3) > 0
      dut.io.request.ready.poke(takes)
      if (takes && dut.io.request.valid.peekBoolean())
        requested.enqueue((now + 1 + random.nextInt(40), dut.io.request.bits.peekInt().toInt))
      owed.values.foreach(since => now - since should be < 600)
      dut.clock.step()
      now += 1
    }
  }
}
