package colonnade.formats

import chisel3._
import chisel3.util.log2Ceil
import colonnade.common.TimingSlice
import colonnade.config.{AttributeLayout, ColonnadeConfig, MapEncoding, NumberFormats}
import colonnade.numbers.{Fixed, FixedPointFormat}

/** One memory of the environment's maps.
  *
  * @param name   MAP.PART
  * @param depth  words
  * @param bits   width of a word, which is in the low bits of a load's record
  * @param target number of the memory for loads
  */
final case class AttributeMemory(name: String, depth: Int, bits: Int, target: Int)

/** A texel of the light cube: linear radiance, mantissas with a common exponent; whether there is a light. */
final class CubeTexel extends Bundle {
  val isLight   = Bool()
  val exponent  = UInt(4.W)
  val mantissas = Rgb(UInt(7.W))

  /** Radiance in the format of the intensity of a light, for a mantissa. */
  def radiance(mantissa: UInt): UInt = (mantissa << exponent)(NumberFormats.lightBits - 1, 0)
}

/** The memories for loads beside the records': of the environment's maps, of the textures, of gathered light. */
object AttributeMemories {

  /** The environment's, if there is one, then the textures', if there are any, then the light cube. */
  def apply(config: ColonnadeConfig): Seq[AttributeMemory] =
    (environment(config) ++ textures(config) ++ lightCube(config)).zipWithIndex.map {
      case ((name, depth, bits), index) =>
        AttributeMemory(name, depth, bits, LoadTarget.firstAttributes + index)
    }

  private def environment(config: ColonnadeConfig): Seq[(String, Int, Int)] =
    config.physicalAttributeMemory.toSeq.flatMap { memory =>
      val layout            = memory.layout
      def map(name: String) = memory.encoding match {
        case MapEncoding.TwoLevel => twoLevel(name, layout.tiles, memory.paletteSize, layout.mapHeapWords)
        case MapEncoding.Slic     => slic(name, layout.tiles, layout.labelWords)
      }
      Seq("albedo", "normals").flatMap(map) ++ Seq(
        ("planes.descriptors", layout.tiles, (new PlaneDescriptor).getWidth),
        ("planes.heap", layout.planeHeapWords, AttributeLayout.heapWordBits),
        ("planes.planes", memory.planes, (new Plane).getWidth),
        ("planes.bounding", memory.boundingPlanes, (new BoundingPlaneEntry).getWidth)
      )
    }

  private def textures(config: ColonnadeConfig): Seq[(String, Int, Int)] =
    config.geometry.texture.toSeq.flatMap(layout =>
      twoLevel("texture", layout.tiles, layout.paletteSize, layout.heapWords)
    )

  /** Texels of a face of the light cube along an edge. */
  val cubeLog: Int = 4

  /** A texel of the light cube. */
  def cubeTexel: CubeTexel = new CubeTexel

  private def lightCube(config: ColonnadeConfig): Seq[(String, Int, Int)] =
    Gather(config).toSeq.map(_ => ("light.cube", 6 << (2 * cubeLog), cubeTexel.getWidth))

  /** Types of the words of the texture memory, as [[layouts]]. */
  def textureLayouts: Seq[(String, () => Bundle)] =
    layouts.filter { case (name, _) => Seq("mapDescriptor", "albedo").contains(name) }

  /** Types of words by their manifest key; a heap's words are plain bits. */
  val layouts: Seq[(String, () => Bundle)] = Seq(
    "mapDescriptor"      -> (() => new MapDescriptor),
    "albedo"             -> (() => new AlbedoEntry),
    "normal"             -> (() => new NormalEntry),
    "planeDescriptor"    -> (() => new PlaneDescriptor),
    "plane"              -> (() => new Plane),
    "boundingPlaneEntry" -> (() => new BoundingPlaneEntry)
  )

  private def twoLevel(name: String, tiles: Int, paletteSize: Int, heapWords: Int): Seq[(String, Int, Int)] = Seq(
    (s"$name.descriptors", tiles, (new MapDescriptor).getWidth),
    (s"$name.palette", paletteSize, AttributeLayout.entryBits),
    (s"$name.heap", heapWords, AttributeLayout.heapWordBits)
  )

  private def slic(name: String, tiles: Int, labelWords: Int): Seq[(String, Int, Int)] = Seq(
    (s"$name.seeds", tiles, AttributeLayout.entryBits),
    (s"$name.labels", labelWords, AttributeLayout.heapWordBits)
  )
}

/** A tile of a two-level map.
  *
  * Modes 0 to 3 select one of two entries per cell; a cell's edge is a half, a quarter, an eighth or a sixteenth of the
  * tile's. Modes 4 to 7 select one of four entries, for the same cells. The mask has one or two bits per cell, row by
  * row from the low bit. It starts at the heap word `pointer`. With four entries, that word holds entries 2 (low byte)
  * and 3, and the mask follows. In mode 0 the mask is the low bits of `pointer`.
  */
final class MapDescriptor extends Bundle {
  val entries = Vec(2, UInt(AttributeLayout.indexBits.W))
  val pointer = UInt(AttributeLayout.pointerBits.W)
  val mode    = UInt(AttributeLayout.modeBits.W)
}

/** A linear colour. */
final class AlbedoEntry extends Bundle {
  val b = FrameRegisters.colour
  val g = FrameRegisters.colour
  val r = FrameRegisters.colour
}

/** A unit normal in view space: x to the right, y down, z forward. */
final class NormalEntry extends Bundle {
  private def component = new Fixed(FixedPointFormat.signed(NumberFormats.normalBits, NumberFormats.normalFraction))

  val z = component
  val y = component
  val x = component
}

/** A tile of the plane map.
  *
  * Mode 0: the whole tile lies in the plane `pointer`. Modes 1 and 2: two planes, for cells of a quarter or an eighth
  * of the tile's edge; the heap word `pointer` holds their ids (0 in the low byte), the mask follows. Modes 3 and 4:
  * four planes, for the same cells; two words of ids, then the mask. Modes 5 and 6: two and four planes, for cells of a
  * sixteenth of the tile's edge.
  */
final class PlaneDescriptor extends Bundle {
  val pointer = UInt(AttributeLayout.pointerBits.W)
  val mode    = UInt(AttributeLayout.modeBits.W)
}

/** A plane of inverse depths: `w = (a · (u − width/2) + b · (v − height/2)) / 1024 + c` at the pixel (u, v), with
  * each coefficient scaled by 2^(exponent − 22).
  */
final class Plane extends Bundle {
  private def coefficient = SInt(AttributeLayout.coefficientBits.W)

  val exponent = UInt(AttributeLayout.exponentBits.W)
  val c        = coefficient
  val b        = coefficient
  val a        = coefficient
}

/** A bounding plane outside the view, with its one colour and normal. */
final class BoundingPlaneEntry extends Bundle {
  val normal = new NormalEntry
  val albedo = new AlbedoEntry
  val plane  = new Plane
}

/** Banks are interleaved by record, a cache's by pair of lines. */
object Banks {

  /** Number of records in one bank of a scratchpad. */
  def depth(config: ColonnadeConfig): Int =
    (config.columnBvhMemory.depth + config.columnBvhMemory.banks - 1) / config.columnBvhMemory.banks

  def addressBits(config: ColonnadeConfig): Int = RecordFormats.addressBits(config) - numberBits(config)

  def isIn(config: ColonnadeConfig, address: UInt, bank: Int): Bool =
    if (config.columnBvhMemory.banks == 1) true.B
    else address(numberBits(config) + wordBits(config) - 1, wordBits(config)) === bank.U

  /** The address in the bank of a record. */
  def addressIn(config: ColonnadeConfig, address: UInt): UInt =
    (address >> (numberBits(config) + wordBits(config))).asUInt ## address(wordBits(config) - 1, 0)

  /** The record at an address in a bank. */
  def recordOf(config: ColonnadeConfig, addressIn: UInt, bank: UInt): UInt =
    (addressIn >> wordBits(config)).asUInt ## bank(numberBits(config) - 1, 0) ## addressIn(wordBits(config) - 1, 0)

  /** Most reads that a bank has in flight; a cache answers after two cycles, or three with an extra slice. */
  def readsInFlight(config: ColonnadeConfig): Int =
    if (config.columnBvhMemory.cache.nonEmpty) 3 + TimingSlice.extra(config).cycles
    else config.columnBvhMemory.readLatency + 1

  private def numberBits(config: ColonnadeConfig): Int = log2Ceil(config.columnBvhMemory.banks)

  /** Address bits within a stripe of a bank. */
  private def wordBits(config: ColonnadeConfig): Int =
    if (config.columnBvhMemory.cache.nonEmpty) log2Ceil(2 * SceneLines.records) else 0
}
