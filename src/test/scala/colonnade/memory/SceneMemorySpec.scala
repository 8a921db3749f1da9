package colonnade.memory

import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RecordFormats, SceneInDram, SceneLines}
import colonnade.{Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

/** Every line that a column requests is announced to it, with the records of the scene in DRAM. */
class SceneMemorySpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "SceneMemory"

  for {
    (columns, banks, sets, ways, bus) <-
      Seq((1, 1, 1, 1, 64), (3, 2, 2, 2, 32), (3, 4, 1, 4, 16), (6, 2, 4, 1, 128), (1, 2, 2, 2, 8), (2, 2, 2, 5, 64))
    extraSlices <- if (columns == 3) Seq(false, true) else Seq(false)
  }
    it should s"serve $columns columns from $banks banks of $sets sets of $ways ways over a bus of $bus bytes, extra slices $extraSlices" in {
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
        val dram = new Dram(dut, config, new Random(columns))
        dram.run(requests = 120)
        val warm = dram.reads
        dram.run(requests = 60, range = 1)
        dram.reads - warm should be <= 2 * banks // held after their first reads
        dut.io.invalidate.poke(true)
        dut.clock.step()
        dut.io.invalidate.poke(false)
        dram.run(requests = 40, range = 1)
        dram.reads - warm should be > 0
      }
    }

  for ((columns, banks) <- Seq((1, 1), (3, 2), (6, 4)))
    it should s"pass lines to $columns columns from $banks banks without a shared cache" in {
      val config =
        TestConfigs.withCache(columns = columns, banks = banks, bus = 4, parity = columns > 3, shared = false)
      test(new SceneMemory(config)).withAnnotations(Simulation.verilator) { dut =>
        val dram = new Dram(dut, config, new Random(columns))
        dram.run(requests = 120)
        dram.reads should be <= 120
        dram.failing = Set(1, 4)
        dram.run(requests = 100)
        dram.errors should be > 1
        dram.failing = Set()
        dram.run(requests = 60)
      }
    }

  it should "announce zeros for a line whose read fails, report it, and read it again" in {
    val config = TestConfigs.withCache(columns = 2)
    test(new SceneMemory(config)).withAnnotations(Simulation.verilator) { dut =>
      val dram = new Dram(dut, config, new Random(1))
      dram.failing = Set(1, 4)
      dram.run(requests = 100)
      dram.errors should be > 1
      dram.failing = Set()
      dram.run(requests = 100)
    }
  }

  /** DRAM with random latency, in order for each id only; and columns that await at most one line in each bank. */
  private class Dram(dut: SceneMemory, config: ColonnadeConfig, random: Random) {
    private val banks    = config.columnBvhMemory.banks
    private val bus      = config.columnBvhMemory.cache.get.busBytes
    private val bits     = new RecordFormats(config).recordBits
    private val lines    = 1 << Lines.lineBits(config)
    private val beats    = (SceneLines.bytes(config) + bus - 1) / bus
    private val page     = 0x1234567
    private var now      = 0
    private val inFlight = Seq.fill(banks)(mutable.Queue.empty[(Int, Int)]) // due, line in its bank
    private val sent     = Array.fill(banks)(0)                             // beats of the first one
    private val wants    = mutable.Map.empty[(Int, Int), (Int, Int)]        // column, bank: line, since
    private val coming   = mutable.Map.empty[(Int, Int, Int), (Int, Int)]   // cycle, bus, bank: line, word
    var failing          = Set.empty[Int]
    var reads            = 0
    var errors           = 0

    dut.clock.setTimeout(0)
    dut.io.page.poke(page)

    private val contents = mutable.Map.empty[(Int, Int), BigInt]

    private def contentOf(bank: Int, line: Int): BigInt =
      contents.getOrElseUpdate((bank, line), BigInt(Lines.records * bits, random))

    private def recordOf(bank: Int, line: Int, word: Int): BigInt =
      (contentOf(bank, line) >> (word * bits)) & ((BigInt(1) << bits) - 1)

    def run(requests: Int, range: Int = lines): Unit = {
      var left = requests
      while (left > 0 || wants.nonEmpty) {
        left -= ask(left, range)
        offer()
        read()
        answer()
        listen()
        dut.clock.step()
        now += 1
      }
      dut.io.requests.flatten.foreach(_.valid.poke(false))
      for (_ <- 1 to 300) { read(); answer(); dut.clock.step(); now += 1 }
      dut.io.isIdle.expect(true)
    }

    private val asking = mutable.Set.empty[(Int, Int)]

    private def ask(left: Int, range: Int): Int = {
      var asked = 0
      for {
        column <- dut.io.requests.indices
        bank   <- 0 until banks
        key = (column, bank)
        if !wants.contains(key) && asked < left && random.nextInt(6) == 0
      } {
        wants(key) = (random.nextInt(range.min(if (random.nextInt(3) == 0) lines else 4)), now)
        asking += key
        asked += 1
      }
      asked
    }

    private def offer(): Unit = {
      val ports = for {
        (column, index) <- dut.io.requests.zipWithIndex
        (port, bank)    <- column.zipWithIndex
      } yield (index, bank) -> port
      for ((key, port) <- ports) {
        port.valid.poke(asking(key))
        if (asking(key)) port.bits.poke(wants(key)._1)
      }
      // Only now: whether a port is ready depends on the others
      for ((key, port) <- ports if asking(key) && port.ready.peekBoolean()) asking -= key
    }

    private def read(): Unit = {
      val ar    = dut.io.axi.ar
      val takes = random.nextInt(3) > 0
      ar.ready.poke(takes)
      if (takes && ar.valid.peekBoolean()) {
        val offset = ar.bits.addr.peekInt() - (BigInt(page) << SceneInDram.pageLog)
        val bank   = ar.bits.id.peekInt().toInt
        offset % SceneLines.pitch(config) shouldBe 0
        val line = (offset / SceneLines.pitch(config)).toInt
        line % banks shouldBe bank
        ar.bits.len.expect(beats - 1)
        (1 << ar.bits.size.peekInt().toInt) shouldBe bus
        ar.bits.burst.expect(1)
        if (config.columnBvhMemory.cache.get.hasSharedCache) inFlight(bank).map(_._2) should not contain (line / banks)
        inFlight(bank).enqueue((now + 1 + random.nextInt(60), line / banks))
        reads += 1
      }
    }

    private def answer(): Unit = {
      val r    = dut.io.axi.r
      val due  = (0 until banks).filter(bank => inFlight(bank).headOption.exists(_._1 <= now))
      val bank = if (due.nonEmpty && random.nextInt(4) > 0) Some(due(random.nextInt(due.size))) else None
      r.valid.poke(bank.nonEmpty)
      for (id <- bank) {
        val line  = inFlight(id).head._2
        val fails = failing(line) && sent(id) == beats / 2
        r.bits.id.poke(id)
        r.bits.data.poke((contentOf(id, line) >> (sent(id) * bus * 8)) & ((BigInt(1) << (bus * 8)) - 1))
        r.bits.resp.poke(if (fails) 2 else 0)
        r.bits.last.poke(sent(id) == beats - 1)
        if (r.ready.peekBoolean()) {
          sent(id) += 1
          if (sent(id) == beats) {
            sent(id) = 0
            inFlight(id).dequeue()
          }
        }
      }
      if (dut.io.events.error.peekBoolean()) errors += 1
    }

    /** Announcements, and the records that follow them. */
    private def listen(): Unit = for {
      (ports, bus) <- dut.io.lines.zipWithIndex
      (port, bank) <- ports.zipWithIndex
    } {
      if (port.announced.valid.peekBoolean()) {
        val line = port.announced.bits.peekInt().toInt
        for (word <- 0 until Lines.records) {
          coming.contains((now + 3 + word, bus, bank)) shouldBe false
          coming((now + 3 + word, bus, bank)) = (line, word)
        }
        wants.filterInPlace { case ((column, of), (wanted, _)) =>
          val gets = SharedCache.busOf(config, column) == bus && of == bank && wanted == line
          if (gets) asking -= ((column, of))
          !gets
        }
      }
      for ((line, word) <- coming.remove((now, bus, bank))) {
        val record   = port.record.peekInt()
        val expected = recordOf(bank, line, word)
        val parity   = if (Lines.hasParity(config)) BigInt(expected.bitCount % 2) << bits else BigInt(0)
        if (!(failing(line) && record == 0)) record shouldBe expected + parity
      }
      wants.values.foreach { case (_, since) => now - since should be < 3000 }
    }
  }
}
