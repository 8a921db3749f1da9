package colonnade.unit

import chisel3._
import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.formats.SceneLines
import colonnade.{Always, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

/** Every fetch gets one response with its record, whichever row reads it and however the ports stall. */
class RecordFetchSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "RecordFetch"

  private def variant(contexts: Int, banks: Int, snooping: Boolean, recordBuffers: Int = 2): ColonnadeConfig =
    TestConfigs.tiny.copy(
      array = TestConfigs.tiny.array.copy(rows = 3, contexts = contexts),
      columnBvhMemory =
        TestConfigs.tiny.columnBvhMemory.copy(banks = banks, snooping = snooping, recordBuffers = recordBuffers)
    )

  private def withExtraSlices(config: ColonnadeConfig): ColonnadeConfig =
    config.copy(units = config.units.copy(extraSlices = true))

  private val row         = 1
  private val recordCount = 24

  /** A kind of which the address may be; a record has one kind at a time. */
  private def kindOf(address: Int): RecordKind.Type = RecordKind.all(address % 5 % 3)

  private def contentOf(address: Int): BigInt = BigInt(address) * 1000003 + 7

  for {
    (contexts, recordBuffers) <- Seq((1, 2), (4, 1), (4, 2), (6, 5))
    banks                     <- Seq(1, 2)
    snooping                  <- Seq(true, false)
  } {
    val name = s"serve $contexts contexts from $banks banks and $recordBuffers buffers, snooping $snooping"
    // `make test` has each value of each option, and each pair of banks and snooping
    val tag = Always.unless(!Seq(
      (1, 2, 1, false),
      (4, 1, 2, true),
      (6, 5, 1, true)
    ).contains((contexts, recordBuffers, banks, snooping)))
    it should name taggedAs tag in {
      val config = variant(contexts, banks, snooping, recordBuffers)
      test(new RecordFetch(config)).withAnnotations(Simulation.verilator) { dut =>
        new Column(dut, config, new Random(contexts * 10 + banks)).run(fetches = 200)
      }
    }
  }

  for ((contexts, snooping) <- Seq((4, true), (4, false), (6, true)))
    it should s"serve $contexts contexts with extra slices, snooping $snooping" taggedAs Always.unless(
      !(contexts == 4 && !snooping)
    ) in {
      val config = withExtraSlices(variant(contexts, banks = 2, snooping))
      test(new RecordFetch(config)).withAnnotations(Simulation.verilator) { dut =>
        new Column(dut, config, new Random(contexts)).run(fetches = 200)
      }
    }

  for {
    (contexts, recordBuffers) <- Seq((1, 1), (4, 1), (6, 2), (6, 4))
    extraSlices               <- Seq(false, true)
  } {
    val later = s"$contexts contexts and $recordBuffers buffers when records come later"
    val tag   = Always.unless(!Seq((4, 1, false), (6, 2, true)).contains((contexts, recordBuffers, extraSlices)))
    it should s"serve $later, extra slices $extraSlices" taggedAs tag in {
      val plain  = variant(contexts, banks = 2, snooping = true, recordBuffers)
      val shape  = if (extraSlices) withExtraSlices(plain) else plain
      val cached = TestConfigs.withCache().columnBvhMemory.cache
      val config = shape.copy(columnBvhMemory = shape.columnBvhMemory.copy(depth = 256, cache = cached))
      test(new RecordFetch(config)).withAnnotations(Simulation.verilator) { dut =>
        new Column(dut, config, new Random(contexts)).run(fetches = 300)
      }
    }
  }

  it should "report an address outside the scene and request every other one" in {
    val config = variant(contexts = 1, banks = 1, snooping = true)
    test(new RecordFetch(config)) { dut =>
      val column = new Column(dut, config, new Random(1))
      for (kind <- RecordKind.all; address <- Seq(0, 7, 23, 24, 40)) withClue(s"$kind at $address: ") {
        dut.reset.asBool.poke(true)
        dut.clock.step()
        dut.reset.asBool.poke(false)
        column.fetch(0, address, kind)
        dut.clock.step()
        dut.io.fetches(0).valid.poke(false.B)
        dut.io.error.valid.peekBoolean() shouldBe address >= recordCount
        dut.io.requests.valid.peekBoolean() shouldBe address < recordCount
        dut.clock.step()
        dut.io.error.valid.expect(false.B)
      }
    }
  }

  /** The column around one fetch: banks with random latency, rows that read random records, units that stall. */
  private class Column(dut: RecordFetch, config: ColonnadeConfig, random: Random) {
    private val banks      = config.columnBvhMemory.banks
    private val contexts   = config.array.contexts
    private val hasCache   = config.columnBvhMemory.cache.nonEmpty
    private val inFlight   = Seq.fill(banks)(mutable.Queue.empty[(Int, Int, Int)]) // (due, address, row)
    private val later      = Seq.fill(banks)(mutable.Buffer.empty[(Int, Int)])     // (due, address)
    private val pending    = mutable.Map.empty[Int, (Int, RecordKind.Type)]
    private var now        = 0
    private var issued     = 0
    private var responses  = 0
    private var readyKinds = Seq.empty[RecordKind.Type]
    private var granted    = Option.empty[Int]

    dut.io.row.poke(row.U)
    dut.io.scene.recordCount.poke(recordCount.U)
    dut.io.fetches.foreach(_.valid.poke(false.B))
    dut.io.broadcasts.foreach(_.valid.poke(false.B))

    def fetch(context: Int, address: Int, kind: RecordKind.Type): Unit = {
      val port = dut.io.fetches(0)
      port.valid.poke(true.B)
      port.bits.context.poke(context.U)
      port.bits.kind.poke(kind)
      port.bits.address.poke(address.U)
      pending(context) = (address, kind)
    }

    def run(fetches: Int): Unit = {
      while (responses < fetches && now < 40 * fetches) {
        broadcast()
        acceptRequest()
        checkResponse()
        val idle = (0 until contexts).filterNot(pending.contains)
        dut.io.fetches(0).valid.poke(false.B)
        if (issued < fetches && idle.nonEmpty && random.nextInt(3) > 0) {
          val address = random.nextInt(recordCount)
          fetch(idle(random.nextInt(idle.size)), address, kindOf(address))
          issued += 1
        }
        dut.clock.step()
        now += 1
      }
      responses shouldBe fetches
    }

    /** Banks are interleaved as in [[colonnade.formats.Banks]]. */
    private def bankOf(address: Int): Int = (if (hasCache) address / (2 * SceneLines.records) else address) % banks

    private def recordIn(bank: Int): Int = {
      val records = (0 until recordCount).filter(bankOf(_) == bank)
      records(random.nextInt(records.size))
    }

    private def broadcast(): Unit = for (bank <- 0 until banks) {
      val port = dut.io.broadcasts(bank)
      if (random.nextInt(4) == 0)
        inFlight(bank).enqueue((now + 1 + random.nextInt(5), recordIn(bank), 2))
      val isDue  = inFlight(bank).headOption.exists(_._1 <= now)
      val filled = later(bank).indexWhere(_._1 <= now)
      port.valid.poke((isDue || filled >= 0).B)
      port.bits.isLater.foreach(_.poke(false.B))
      if (isDue) {
        val (_, address, reader) = inFlight(bank).dequeue()
        val comesLater           = hasCache && (later(bank).exists(_._2 == address) || random.nextInt(2) == 0)
        port.bits.address.poke(address.U)
        port.bits.record.poke((if (comesLater) BigInt(random.nextInt(99)) else contentOf(address)).U)
        port.bits.row.poke(reader.U)
        if (comesLater) {
          port.bits.isLater.get.poke(true.B)
          if (!later(bank).exists(_._2 == address)) later(bank) += ((now + 1 + random.nextInt(30), address))
        }
      } else if (filled >= 0) {
        val (_, address) = later(bank).remove(filled)
        port.bits.address.poke(address.U)
        port.bits.record.poke(contentOf(address).U)
        port.bits.row.poke(random.nextInt(3).U)
      }
    }

    private def acceptRequest(): Unit = {
      val accepts = random.nextInt(3) > 0
      dut.io.requests.ready.poke(accepts.B)
      if (accepts && dut.io.requests.valid.peekBoolean()) {
        val address = dut.io.requests.bits.address.peekInt().toInt
        inFlight(bankOf(address)).enqueue((now + 1 + random.nextInt(5), address, row))
      }
    }

    /** A response follows its grant by one cycle, and goes to a unit that was ready. */
    private def checkResponse(): Unit = {
      val port = dut.io.response
      port.valid.expect(granted.nonEmpty)
      for (context <- granted) {
        port.bits.context.expect(context)
        val kind = port.bits.kind.peek()
        readyKinds.map(_.litValue) should contain(kind.litValue)
        withClue(s"context $context: ") { pending.get(context).map(_._2.litValue) shouldBe Some(kind.litValue) }
        port.bits.address.expect(pending(context)._1)
        port.bits.record.peekInt() shouldBe contentOf(pending(context)._1)
        pending -= context
        responses += 1
      }
      readyKinds = RecordKind.all.zip(dut.io.readyNext).collect { case (kind, port) if isReady(port) => kind }
      granted = Option.when(dut.io.grantNext.valid.peekBoolean())(dut.io.grantNext.bits.peekInt().toInt)
    }

    private def isReady(port: Bool): Boolean = {
      val accepts = random.nextInt(3) > 0
      port.poke(accepts)
      accepts
    }
  }
}
