package colonnade.config

/** How the maps of albedo and normals are stored. */
sealed abstract class MapEncoding(val name: String)

object MapEncoding {

  /** Each tile has a mode: two or four palette entries, and the size of the cells that select one of them. */
  object TwoLevel extends MapEncoding("twoLevel")

  /** SLIC superpixels: a tile has one seed, and the label of a block of pixels selects one of the nine nearest seeds. */
  object Slic extends MapEncoding("slic")

  val all: Seq[MapEncoding] = Seq(TwoLevel, Slic)

  def named(name: String): Option[MapEncoding] = all.find(_.name == name)
}

/** The on-chip maps of the environment: albedo, normals and planes.
  *
  * @param width          width of the maps, pixels
  * @param height         height of the maps, pixels
  * @param encoding       encoding of albedo and normals, twoLevel or slic: docs/attributes.md#encodings
  * @param tileSize       edge of a tile, pixels
  * @param paletteSize    entries of a two-level map's palette
  * @param mapBytes       bytes of the albedo map, and of the normal map; descriptors and palette leave at most 16,384
  *                       bytes as heap
  * @param planes         entries of the plane table
  * @param planeBytes     bytes of plane map, plane table and bounding planes; the rest is heap, at most 16,384 bytes
  * @param boundingPlanes bounding planes, beyond the view
  * @param columnsPerCopy columns that read one copy of the maps (docs/attributes.md#copies); more than the array has: all
  */
final case class PhysicalAttributeMemoryConfig(
    width:          Int = 640,
    height:         Int = 480,
    encoding:       MapEncoding = MapEncoding.TwoLevel,
    tileSize:       Int = 16,
    paletteSize:    Int = 256,
    mapBytes:       Int = 16384,
    planes:         Int = 128,
    planeBytes:     Int = 12288,
    boundingPlanes: Int = 8,
    columnsPerCopy: Int = 1
) {
  import PhysicalAttributeMemoryConfig._

  Require.within(s"$section.width", width, 64, 4096)
  Require.within(s"$section.height", height, 64, 4096)
  Require.oneOf(s"$section.tileSize", tileSize, Seq(16, 32))
  Require.oneOf(s"$section.paletteSize", paletteSize, powers)
  Require.oneOf(s"$section.planes", planes, powers)
  Require.within(s"$section.boundingPlanes", boundingPlanes, 2, 16)
  Require.within(s"$section.columnsPerCopy", columnsPerCopy, 1, ArrayConfig.maxColumns)

  /** All derived sizes. */
  val layout: AttributeLayout = AttributeLayout(this)
}

object PhysicalAttributeMemoryConfig {
  private[config] val section = "physicalAttributeMemory"
  private val powers          = Seq(16, 32, 64, 128, 256) // an index has one byte at most
}
