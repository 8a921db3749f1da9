package colonnade.environment

import chisel3.Clock
import chisel3.util.Valid
import chiseltest._
import colonnade.{Model, Packed}
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{AttributeMemories, BoundingPlaneEntry, Load, MapDescriptor, Plane, PlaneDescriptor}

import scala.util.Random

/** A room with a box, encoded as planes in a map's tiles: floor, ceiling, three walls, the box's front and top. View
  * space, metres. A tile is flat, or its cells have a quarter, an eighth or a sixteenth of its edge, as the planes need
  * and the heap permits.
  */
final class EnvironmentScene(config: ColonnadeConfig, random: Random) {
  import EnvironmentScene._

  private val layout = AttributeLayout.of(config)

  /** Pixels. */
  val focal:  Double      = 0.8 * layout.config.width
  val middle: Seq[Double] = Seq(layout.config.width / 2.0 + 3.2, layout.config.height / 2.0 - 1.7)

  /** Inverse depth at a pixel; meaningless if the plane is behind the camera. */
  private def inverse(plane: Surface, x: Double, y: Double): Double = {
    val ray = Seq((x - middle(0)) / focal, (y - middle(1)) / focal, 1.0)
    plane.normal.zip(ray).map { case (n, r) => n * r }.sum / plane.distance
  }

  private def idAt(x: Int, y: Int): Int = {
    val depths = surfaces.map(surface => inverse(surface, x + 0.5, y + 0.5))
    val walls  = (0 until 5).maxBy(depths)
    val inBox  = boxes.find { id =>
      val z     = 1 / depths(id)
      val point = Seq((x + 0.5 - middle(0)) / focal * z, (y + 0.5 - middle(1)) / focal * z, z)
      z > 0 && point(0).abs < 0.6 && point(1) > 0.39 && point(2) > 1.99 && point(2) < 2.8 && depths(id) > depths(walls)
    }
    inBox.getOrElse(walls)
  }

  private def word(surface: Surface): Map[String, BigInt] = {
    val (x, y)                              = (layout.config.width / 2.0, layout.config.height / 2.0)
    val a                                   = (inverse(surface, x + 1, y) - inverse(surface, x, y)) * 1024 * depthUnit
    val b                                   = (inverse(surface, x, y + 1) - inverse(surface, x, y)) * 1024 * depthUnit
    val all                                 = Seq("a" -> a, "b" -> b, "c" -> inverse(surface, x, y) * depthUnit)
    def field(value: Double, exponent: Int) =
      BigDecimal(value * math.pow(2, 22.0 - exponent)).setScale(0, BigDecimal.RoundingMode.HALF_EVEN).toBigInt
    val exponent = (0 to 15).find(e => all.forall(c => field(c._2, e).abs < (1 << 19))).get
    all.map { case (name, value) => name -> field(value, exponent) }.toMap + ("exponent" -> BigInt(exponent))
  }

  /** By the memory's name; albedo and normals at random. */
  val words: Map[String, Seq[BigInt]] = {
    val others      = new EnvironmentImage(config, random).words
    val heap        = scala.collection.mutable.ArrayBuffer.empty[BigInt]
    val descriptors = for {
      row    <- 0 until layout.tileRows
      column <- 0 until layout.tileColumns
    } yield {
      def idsOf(cells: Int) = {
        val edge = layout.config.tileSize / cells
        for (y <- 0 until cells; x <- 0 until cells)
          yield idAt((column * cells + x) * edge + edge / 2, (row * cells + y) * edge + edge / 2)
      }
      val size  = random.nextInt(3)
      val cells = idsOf(4 << size)
      val ids   = random.shuffle(cells.distinct).take(4)
      val count = if (ids.size == 1 && random.nextInt(6) != 0) 1 else if (ids.size <= 2) 2 else 4
      val bits  = count / 2
      val words = bits + (cells.size * bits + 15) / 16
      if (count == 1 || heap.size + words > layout.planeHeapWords) descriptor(0, ids.head)
      else {
        val named   = ids.padTo(count, ids.last)
        val pointer = heap.size
        heap ++= named.grouped(2).map(two => BigInt(two(0) | two(1) << 8))
        val mask = cells.zipWithIndex.map { case (id, i) => BigInt(named.indexOf(id).max(0)) << (i * bits) }.sum
        heap ++= Seq.tabulate((cells.size * bits + 15) / 16)(i => (mask >> (16 * i)) & 0xffff)
        descriptor((if (count == 4) Seq(3, 4, 6) else Seq(1, 2, 5)) (size), pointer)
      }
    }
    val table = surfaces.map(surface => new Packed(new Plane).pack(word(surface)))
    val shell = surfaces.take(5).map(surface =>
      new Packed(new BoundingPlaneEntry).pack(
        word(surface).map { case (name, value) => s"plane.$name" -> value } ++
          Seq("r", "g", "b").map(channel => s"albedo.$channel" -> BigInt(12, random)) ++
          Seq("x", "y", "z").map(axis => s"normal.$axis" -> (BigInt(12, random) - 2048))
      )
    )
    val made = Map(
      "planes.descriptors" -> descriptors,
      "planes.heap"        -> heap.toSeq,
      "planes.planes"      -> table,
      "planes.bounding"    -> shell
    )
    AttributeMemories(config).map { memory =>
      memory.name -> made.get(memory.name).fold(others(memory.name))(_.take(memory.depth).padTo(
        memory.depth,
        BigInt(0)
      ))
    }.toMap
  }

  private def descriptor(mode: Int, pointer: Int): BigInt =
    new Packed(new PlaneDescriptor).pack(Map("mode" -> mode, "pointer" -> pointer))
}

object EnvironmentScene {
  private final case class Surface(normal: Seq[Double], distance: Double)

  /** Floor, ceiling, left, right and back wall, the box's front and top. */
  private val surfaces = Seq(
    Surface(Seq(0, 1, 0), 1.2),
    Surface(Seq(0, -1, 0), 1.3),
    Surface(Seq(-1, 0, 0), 2),
    Surface(Seq(1, 0, 0.1), 2.2),
    Surface(Seq(0, 0.05, 1), 4),
    Surface(Seq(0, 0, 1), 2),
    Surface(Seq(0, 1, 0), 0.4)
  )
  private val boxes = Seq(5, 6)

  val depthUnit: Double = 0.9
}

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
