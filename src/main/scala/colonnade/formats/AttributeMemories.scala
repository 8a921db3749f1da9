package colonnade.formats

import chisel3.Bundle
import colonnade.config.{AttributeLayout, ColonnadeConfig}

/** One memory of the environment's maps.
  *
  * @param name   MAP.PART
  * @param depth  words
  * @param bits   width of a word, which is in the low bits of a load's record
  * @param target number of the memory for loads
  */
final case class AttributeMemory(name: String, depth: Int, bits: Int, target: Int)

/** All memories of the environment's maps. */
object AttributeMemories {

  /** Empty for a device without an environment. */
  def apply(config: ColonnadeConfig): Seq[AttributeMemory] =
    config.physicalAttributeMemory.toSeq.flatMap { memory =>
      val layout = memory.layout
      val shapes = map("albedo", layout) ++ map("normals", layout) ++ Seq(
        ("planes.descriptors", layout.tiles, (new PlaneDescriptor).getWidth),
        ("planes.heap", layout.planeHeapWords, AttributeLayout.heapWordBits),
        ("planes.planes", memory.planes, (new Plane).getWidth),
        ("planes.bounding", memory.boundingPlanes, (new BoundingPlaneEntry).getWidth)
      )
      shapes.zip(LoadTarget.firstAttributes until LoadTarget.firstAttributes + shapes.size).map {
        case ((name, depth, bits), target) => AttributeMemory(name, depth, bits, target)
      }
    }

  /** Types of words by their manifest key; a heap's words are plain bits. */
  val layouts: Seq[(String, () => Bundle)] = Seq(
    "mapDescriptor"   -> (() => new MapDescriptor),
    "albedo"          -> (() => new AlbedoEntry),
    "normal"          -> (() => new NormalEntry),
    "planeDescriptor" -> (() => new PlaneDescriptor),
    "plane"           -> (() => new Plane),
    "boundingPlaneEntry"      -> (() => new BoundingPlaneEntry)
  )

  private def map(name: String, layout: AttributeLayout): Seq[(String, Int, Int)] =
    if (layout.isSliding)
      Seq(
        (s"$name.labels", layout.labelWords, AttributeLayout.heapWordBits),
        (s"$name.seeds", layout.tiles, AttributeLayout.entryBits)
      )
    else
      Seq(
        (s"$name.descriptors", layout.tiles, (new MapDescriptor).getWidth),
        (s"$name.palette", layout.config.paletteSize, AttributeLayout.entryBits),
        (s"$name.heap", layout.mapHeapWords, AttributeLayout.heapWordBits)
      )
}
