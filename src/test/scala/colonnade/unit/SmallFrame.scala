package colonnade.unit

import chisel3.util.{DecoupledIO, Valid}
import chiseltest._
import colonnade.Model
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RecordBroadcast, RecordRequest}
import org.scalatest.Assertions._

import scala.collection.mutable
import scala.util.Random

/** A frame with the pixels that the model shows.
  *
  * @param registers the host's, by name
  * @param size      pixels
  * @param maps      words of each memory of the environment, if there is one
  */
final class SmallFrame(
    config:        ColonnadeConfig,
    val registers: Map[String, BigInt],
    val records:   Seq[BigInt],
    size:          (Int, Int),
    maps:          Option[Map[String, Seq[BigInt]]] = None
) {
  import SmallFrame._

  val positions: Seq[(Int, Int)] = for (x <- 0 until size._1; y <- 0 until size._2) yield (x, y)

  /** In the order of the positions, with other registers. */
  def modelled(registers: Map[String, BigInt]): Seq[Map[String, BigInt]] =
    Model.pixels(config, registers, records, positions, maps).map(names.zip(_).toMap)

  val expected: Seq[Map[String, BigInt]] = modelled(registers)

  /** Pixels that show the object. */
  val hits: Int = expected.count(_("isObject") == 1)

  /** Each pixel comes once, with the model's values, and those that show the object are counted. */
  def check(pixels: Seq[((Int, Int), Map[String, BigInt])], counts: String => Int): Unit = {
    assert(pixels.map(_._1).sorted == positions.sorted, "every position comes out once")
    val found = pixels.toMap
    for ((position, pixel) <- positions.zip(expected))
      assert(found(position) == pixel.filter(value => found(position).contains(value._1)), s"at $position")
    assert(counts("hits") == hits)
  }

  /** Rays of all kinds that the frame may have are traced. */
  def checkRays(counts: String => Int, shadows: Boolean): Unit = {
    assert(hits > positions.size / 16, "there is something to see")
    assert(if (shadows) counts("raysShadow") > hits / 8 else counts("raysShadow") == 0)
    assert((counts("raysReflection") + counts("raysRefraction") > 0) == config.frame.hasBounces)
  }
}

object SmallFrame {
  private val names = Seq("colour.r", "colour.g", "colour.b", "isObject", "hit.triangle", "hit.distance") ++
    Seq("r", "g", "b").map(channel => s"ratio.$channel")

  val (wide, high) = (12, 8)

  def scene(config: ColonnadeConfig, seed: Int, shadows: Boolean): SmallScene =
    new SmallScene(config, seed, wide, high, triangleCount = 15, shadows)

  /** Of a small scene without an environment. */
  def apply(config: ColonnadeConfig, scene: SmallScene): SmallFrame =
    new SmallFrame(config, scene.registers, scene.records, (wide, high))
}

/** The records of a scene, by banks of random latency, which read a record once for all who ask for it while it is
  * read.
  *
  * @param firstRow row of the first one of the requests
  */
final class FakeRecords(
    config:     ColonnadeConfig,
    requests:   Seq[DecoupledIO[RecordRequest]],
    firstRow:   Int,
    broadcasts: Seq[Valid[RecordBroadcast]],
    records:    Seq[BigInt],
    random:     Random
) {
  private case class Read(due: Int, address: Int, row: Int)
  private val inFlight = broadcasts.map(_ => mutable.Queue.empty[Read])
  private var now      = 0

  /** @param willing probability that a bank accepts a request in a cycle */
  def cycle(willing: Double): Unit = {
    for ((port, reads) <- broadcasts.zip(inFlight)) {
      val due = reads.headOption.filter(_.due <= now)
      port.valid.poke(due.nonEmpty)
      for (read <- due) {
        port.bits.address.poke(read.address)
        port.bits.record.poke(records(read.address))
        port.bits.row.poke(read.row)
        reads.dequeue()
      }
    }
    val asking = requests.zipWithIndex.collect {
      case (port, index) if port.valid.peekBoolean() => index -> port.bits.address.peekInt().toInt
    }
    requests.foreach(_.ready.poke(false))
    for ((reads, bank) <- inFlight.zipWithIndex if random.nextDouble() < willing) {
      val isRead = reads.map(_.address).filter(_ => config.columnBvhMemory.snooping).toSet
      val ours   = asking.filter { case (_, address) => address % inFlight.size == bank && !isRead(address) }
      if (ours.nonEmpty) {
        val (index, address) = ours(random.nextInt(ours.size))
        requests(index).ready.poke(true)
        reads.enqueue(Read(now + 1 + random.nextInt(6), address, firstRow + index))
      }
    }
    now += 1
  }
}
