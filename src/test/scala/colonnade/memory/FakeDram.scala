package colonnade.memory

import chisel3.UInt
import chisel3.util.DecoupledIO
import chiseltest._
import colonnade.axi.AxiReadPort
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RecordFormats, SceneInDram, SceneLines}
import org.scalatest.matchers.should.Matchers._

import scala.collection.mutable
import scala.util.Random

/** A scene of random records in DRAM: reads of random latency, in order for each id only.
  *
  * @param isShared a line is not read twice at a time
  */
class FakeDram(axi: AxiReadPort, config: ColonnadeConfig, random: Random, isShared: Boolean) {
  private val banks = config.columnBvhMemory.banks
  private val bus   = config.columnBvhMemory.cache.get.busBytes
  private val bits  = new RecordFormats(config).recordBits
  private val beats = (SceneLines.bytes(config) + bus - 1) / bus

  /** A line of a bank that is read: the cycle from which on it is sent, and the beat that fails, if one does. */
  private case class Read(line: Int, due: Int, failingBeat: Int)
  private val inFlight = Seq.fill(banks)(mutable.Queue.empty[Read])
  private val sent     = Array.fill(banks)(0) // beats of the first one
  private val contents = mutable.Map.empty[(Int, Int), BigInt]
  private var now      = 0

  val page: BigInt = 0x1234567

  /** Lines, by their number in a bank, whose reads fail; the banks where they do. */
  var failing      = Set.empty[Int]
  var failingBanks = (0 until banks).toSet

  /** Lines whose read has been accepted, those of them that fail, and beats that have been taken. */
  var reads, failed, taken = 0

  def fails(bank: Int, line: Int): Boolean = failing(line) && failingBanks(bank)

  private def contentOf(bank: Int, line: Int): BigInt =
    contents.getOrElseUpdate((bank, line), BigInt(Lines.records * bits, random))

  /** Without its parity. */
  def record(bank: Int, line: Int, word: Int): BigInt =
    (contentOf(bank, line) >> (word * bits)) & ((BigInt(1) << bits) - 1)

  def cycle(): Unit = {
    read()
    answer()
    now += 1
  }

  private def read(): Unit = {
    val ar      = axi.ar
    val accepts = random.nextInt(3) > 0
    ar.ready.poke(accepts)
    if (accepts && ar.valid.peekBoolean()) {
      val address = ar.bits.addr.peekInt() - (page << SceneInDram.pageLog)
      val bank    = ar.bits.id.peekInt().toInt
      address % SceneLines.pitch(config) shouldBe 0
      val number = (address / SceneLines.pitch(config)).toInt
      val line   = number / 2 / banks * 2 + number % 2
      number / 2 % banks shouldBe bank
      ar.bits.len.expect(beats - 1)
      (1 << ar.bits.size.peekInt().toInt) shouldBe bus
      ar.bits.burst.expect(1)
      if (isShared) inFlight(bank).map(_.line) should not contain line
      val failingBeat = if (fails(bank, line)) random.nextInt(beats) else -1
      inFlight(bank).enqueue(Read(line, now + 1 + random.nextInt(60), failingBeat))
      reads += 1
      if (failingBeat >= 0) failed += 1
    }
  }

  private def answer(): Unit = {
    val r    = axi.r
    val due  = (0 until banks).filter(bank => inFlight(bank).headOption.exists(_.due <= now))
    val bank = if (due.nonEmpty && random.nextInt(4) > 0) Some(due(random.nextInt(due.size))) else None
    r.valid.poke(bank.nonEmpty)
    for (id <- bank) {
      val read = inFlight(id).head
      r.bits.id.poke(id)
      r.bits.data.poke((contentOf(id, read.line) >> (sent(id) * bus * 8)) & ((BigInt(1) << (bus * 8)) - 1))
      r.bits.resp.poke(if (sent(id) == read.failingBeat) 2 else 0)
      r.bits.last.poke(sent(id) == beats - 1)
      if (r.ready.peekBoolean()) {
        taken += 1
        sent(id) += 1
        if (sent(id) == beats) {
          sent(id) = 0
          inFlight(id).dequeue()
        }
      }
    }
  }
}

/** Columns in front of a bank, each of which awaits at most one line. Every line that is announced must come whole, and
  * at its time.
  *
  * @param requests by column
  * @param lines    by bus
  * @param allowed  what may come as a record, by line and word, without its parity
  */
class FakeColumns(
    config:   ColonnadeConfig,
    requests: Seq[DecoupledIO[UInt]],
    lines:    Seq[LineBroadcast],
    allowed:  (Int, Int) => Set[BigInt],
    random:   Random
) {
  private val bits   = new RecordFormats(config).recordBits
  private val wants  = mutable.Map.empty[Int, (Int, Int)]         // by column: line, since
  private val asking = mutable.Set.empty[Int]                     // requests that are not yet accepted
  private val coming = mutable.Map.empty[(Int, Int), Set[BigInt]] // by cycle and bus
  private var now    = 0

  /** All lines that were requested. */
  val issued = mutable.Set.empty[Int]

  def isWaiting: Boolean = wants.nonEmpty

  /** Offers requests for lines below `range`, `most` new ones at most; returns their number. */
  def offer(most: Int, range: Int): Int = {
    val news = requests.indices.filter(column => !wants.contains(column) && random.nextInt(6) == 0).take(most)
    for (column <- news) {
      val line = random.nextInt(if (random.nextInt(3) == 0) range else range.min(4))
      wants(column) = (line, now)
      issued += line
    }
    asking ++= news
    for ((port, column) <- requests.zipWithIndex) {
      port.valid.poke(asking(column))
      if (asking(column)) port.bits.poke(wants(column)._1)
    }
    news.size
  }

  /** After all inputs of the cycle are known: what is accepted, announced and sent. */
  def take(): Unit = {
    asking.filterInPlace(column => !requests(column).ready.peekBoolean())
    for ((port, bus) <- lines.zipWithIndex) {
      if (port.announced.valid.peekBoolean()) {
        val line = port.announced.bits.peekInt().toInt
        for (word <- 0 until Lines.records) {
          val at = (now + LineBroadcast.latency + word, bus)
          coming.contains(at) shouldBe false
          coming(at) = allowed(line, word)
        }
        val done = wants.collect {
          case (column, (wanted, _)) if wanted == line && SharedCache.busOf(config, column) == bus => column
        }
        asking --= done
        wants --= done
      }
      for (records <- coming.remove((now, bus))) records.map { record =>
        if (Lines.hasParity(config)) record + (BigInt(record.bitCount % 2) << bits) else record
      } should contain(port.record.peekInt())
    }
    wants.values.foreach { case (_, since) => now - since should be < 3000 }
    now += 1
  }
}
