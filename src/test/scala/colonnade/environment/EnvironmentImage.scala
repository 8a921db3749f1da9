package colonnade.environment

import chisel3.Clock
import chisel3.util.Valid
import chiseltest._
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{AttributeMemories, Load, MapDescriptor, PlaneDescriptor}
import colonnade.{Model, Packed}

import scala.util.Random

/** Random contents of an environment's memories, in every mode, with pointers inside the heap.
  *
  * @param illegal share of tiles with arbitrary pointers
  */
final class EnvironmentImage(config: ColonnadeConfig, random: Random, illegal: Double = 0) {
  private val layout = AttributeLayout.of(config)

  /** By the memory's name. */
  val words: Map[String, Seq[BigInt]] = AttributeMemories(config).map { memory =>
    memory.name -> Seq.fill(memory.depth)(memory.name match {
      case "planes.descriptors"                 => planeDescriptor()
      case name if name.endsWith("descriptors") => mapDescriptor()
      case _                                    => BigInt(memory.bits, random)
    })
  }.toMap

  def pixel(): (Int, Int) = (random.nextInt(layout.config.width), random.nextInt(layout.config.height))

  /** Every edge and corner of the map, and of the first tiles. */
  val corners: Seq[(Int, Int)] = for {
    y <- Seq(0, 1, layout.config.tileSize - 1, layout.config.tileSize, layout.config.height - 1)
    x <- Seq(0, 1, layout.config.tileSize - 1, layout.config.tileSize, layout.config.width - 1)
  } yield (x, y)

  /** The model's answers; see environment_queries.hpp. */
  def ask(kind: String, questions: Seq[Seq[BigInt]]): Seq[Seq[BigInt]] =
    Model.attributes(config, words, questions, kind)

  private def mapDescriptor(): BigInt = {
    val mode      = random.nextInt(8)
    val cells     = 4 << (2 * (mode % 4))
    val maskWords = if (mode < 4) (cells + 15) / 16 else 1 + (2 * cells + 15) / 16
    val pointer   = if (mode == 0) randomPointer() else pointerTo(maskWords, layout.mapHeapWords)
    new Packed(new MapDescriptor).pack(
      Map(
        "mode"       -> mode,
        "pointer"    -> pointer,
        "entries[0]" -> random.nextInt(256),
        "entries[1]" -> random.nextInt(256)
      )
    )
  }

  private def planeDescriptor(): BigInt = {
    val mode    = random.nextInt(8)
    val words   = Map(1 -> 2, 2 -> 5, 3 -> 4, 4 -> 10, 5 -> 17, 6 -> 34).get(mode)
    val pointer = words.fold(randomPointer())(pointerTo(_, layout.planeHeapWords))
    new Packed(new PlaneDescriptor).pack(Map("mode" -> mode, "pointer" -> pointer))
  }

  /** A pointer to words of a heap; an illegal one is arbitrary, or the last of its words is the first beyond the heap,
    * where pointers reach that word.
    */
  private def pointerTo(words: Int, heapWords: Int): Int =
    if (random.nextDouble() >= illegal) random.nextInt(heapWords - words + 1)
    else if (random.nextBoolean()) randomPointer()
    else (heapWords - words + 1).min((1 << AttributeLayout.pointerBits) - 1)

  private def randomPointer(): Int = random.nextInt(1 << AttributeLayout.pointerBits)
}

object EnvironmentImage {

  /** Fills all memories of an environment. */
  def load(port: Valid[Load], clock: Clock, config: ColonnadeConfig, words: Map[String, Seq[BigInt]]): Unit = {
    port.valid.poke(true)
    for (memory <- AttributeMemories(config); (word, address) <- words(memory.name).zipWithIndex) {
      port.bits.target.poke(memory.target)
      port.bits.address.poke(address)
      port.bits.record.poke(word)
      clock.step()
    }
    port.valid.poke(false)
  }
}
