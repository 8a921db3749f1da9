package colonnade.unit

import chisel3._
import chiseltest._
import colonnade.TestConfigs
import colonnade.config.ColonnadeConfig
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

/** Every wish is served once, with its record, whoever reads it and however the ports stall. */
class RecordFetchSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "RecordFetch"

  private def variant(contexts: Int, banks: Int, snooping: Boolean, recordBuffers: Int = 2): ColonnadeConfig =
    TestConfigs.tiny.copy(
      array = TestConfigs.tiny.array.copy(rows = 3, contexts = contexts),
      columnBvhMemory =
        TestConfigs.tiny.columnBvhMemory.copy(banks = banks, snooping = snooping, recordBuffers = recordBuffers)
    )

  private val row         = 1
  private val recordCount = 24

  /** Nodes, triangles and attributes. */
  private val sections = Seq(0 until 8, 8 until 16, 16 until recordCount)

  private def useOf(address: Int): RecordUse.Type = RecordUse.all(sections.indexWhere(_.contains(address)))

  private def contentOf(address: Int): BigInt = BigInt(address) * 1000003 + 7

  for {
    (contexts, recordBuffers) <- Seq((1, 2), (4, 1), (4, 2), (6, 5))
    banks                     <- Seq(1, 2)
    snooping                  <- Seq(true, false)
  } {
    it should s"serve $contexts contexts from $banks banks and $recordBuffers buffers, snooping $snooping" in {
      val config = variant(contexts, banks, snooping, recordBuffers)
      test(new RecordFetch(config)) { dut =>
        new Column(dut, config, new Random(contexts * 10 + banks)).run(wishes = 200)
      }
    }
  }

  it should "refuse an address outside the section of its use and ask for every other one" in {
    val config = variant(contexts = 1, banks = 1, snooping = true)
    test(new RecordFetch(config)) { dut =>
      val column = new Column(dut, config, new Random(1))
      for {
        (use, section) <- RecordUse.all.zip(sections)
        address        <- Seq(0, 7, 8, 15, 16, 23, 24, 40)
        // A face lies behind the base of its section
        if use != RecordUse.attributes || address >= section.start
      } withClue(s"$use at $address: ") {
        dut.reset.asBool.poke(true)
        dut.clock.step()
        dut.reset.asBool.poke(false)
        column.wish(0, address, use)
        dut.clock.step()
        dut.io.wishes(0).valid.poke(false.B)
        dut.io.refused.valid.peekBoolean() shouldBe !section.contains(address)
        dut.io.requests.valid.peekBoolean() shouldBe section.contains(address)
        dut.clock.step()
        dut.io.refused.valid.expect(false.B)
      }
    }
  }

  /** The column around one fetch: banks that answer after a while, rows that read what they like, units that stall. */
  private class Column(dut: RecordFetch, config: ColonnadeConfig, random: Random) {
    private val banks    = config.columnBvhMemory.banks
    private val contexts = config.array.contexts
    private val inFlight = Seq.fill(banks)(mutable.Queue.empty[(Int, Int, Int)]) // (due, address, row)
    private val wanted   = mutable.Map.empty[Int, (Int, RecordUse.Type)]
    private var now      = 0
    private var made     = 0
    private var served   = 0
    private var takers   = Seq.empty[RecordUse.Type]
    private var chosen   = Option.empty[Int]

    dut.io.row.poke(row.U)
    dut.io.scene.recordCount.poke(recordCount.U)
    dut.io.scene.triangleBase.poke(sections(1).start.U)
    dut.io.scene.attributeBase.poke(sections(2).start.U)
    dut.io.wishes.foreach(_.valid.poke(false.B))
    dut.io.broadcasts.foreach(_.valid.poke(false.B))

    def wish(context: Int, address: Int, use: RecordUse.Type): Unit = {
      val port = dut.io.wishes(0)
      port.valid.poke(true.B)
      port.bits.context.poke(context.U)
      port.bits.use.poke(use)
      port.bits.address.poke(address.U)
      wanted(context) = (address, use)
    }

    def run(wishes: Int): Unit = {
      while (served < wishes && now < 40 * wishes) {
        broadcast()
        takeRequest()
        takeServed()
        val idle = (0 until contexts).filterNot(wanted.contains)
        dut.io.wishes(0).valid.poke(false.B)
        if (made < wishes && idle.nonEmpty && random.nextInt(3) > 0) {
          val address = random.nextInt(recordCount)
          wish(idle(random.nextInt(idle.size)), address, useOf(address))
          made += 1
        }
        dut.clock.step()
        now += 1
      }
      served shouldBe wishes
    }

    private def broadcast(): Unit = for (bank <- 0 until banks) {
      val port = dut.io.broadcasts(bank)
      if (random.nextInt(4) == 0)
        inFlight(bank).enqueue((now + 1 + random.nextInt(5), random.nextInt(recordCount / banks) * banks + bank, 2))
      val isDue = inFlight(bank).headOption.exists(_._1 <= now)
      port.valid.poke(isDue.B)
      if (isDue) {
        val (_, address, reader) = inFlight(bank).dequeue()
        port.bits.address.poke(address.U)
        port.bits.record.poke(contentOf(address).U)
        port.bits.row.poke(reader.U)
      }
    }

    private def takeRequest(): Unit = {
      val takes = random.nextInt(3) > 0
      dut.io.requests.ready.poke(takes.B)
      if (takes && dut.io.requests.valid.peekBoolean()) {
        val address = dut.io.requests.bits.address.peekInt().toInt
        inFlight(address % banks).enqueue((now + 1 + random.nextInt(5), address, row))
      }
    }

    /** Who is served was chosen in the cycle before, for a unit that had promised to take it. */
    private def takeServed(): Unit = {
      val port = dut.io.served
      port.valid.expect(chosen.nonEmpty)
      for (context <- chosen) {
        port.bits.context.expect(context)
        val use = port.bits.use.peek()
        takers.map(_.litValue) should contain(use.litValue)
        withClue(s"context $context: ") { wanted.get(context).map(_._2.litValue) shouldBe Some(use.litValue) }
        port.bits.address.expect(wanted(context)._1)
        port.bits.record.peekInt() shouldBe contentOf(wanted(context)._1)
        wanted -= context
        served += 1
      }
      takers = RecordUse.all.zip(dut.io.takesNext).collect { case (use, port) if promises(port) => use }
      chosen = Option.when(dut.io.chosen.valid.peekBoolean())(dut.io.chosen.bits.peekInt().toInt)
    }

    private def promises(port: Bool): Boolean = {
      val takes = random.nextInt(3) > 0
      port.poke(takes)
      takes
    }
  }
}
