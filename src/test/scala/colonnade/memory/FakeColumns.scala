package colonnade.memory

import chisel3.UInt
import chisel3.util.DecoupledIO
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.RecordFormats
import org.scalatest.matchers.should.Matchers._

import scala.collection.mutable
import scala.util.Random

/** Columns in front of a bank, each of which awaits at most one line. Every line that is announced must come whole, and at
  * its time.
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
