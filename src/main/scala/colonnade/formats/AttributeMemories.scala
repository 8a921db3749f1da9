package colonnade.formats

import chisel3._
import colonnade.config.{AttributeLayout, ColonnadeConfig, MapEncoding, NumberFormats}

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
