package colonnade.config

/** The on-chip maps of the environment: albedo, normals and planes.
  *
  * @param width       of the maps, pixels
  * @param height      of the maps, pixels
  * @param tileSize    edge of a tile, pixels
  * @param paletteSize entries of a map's palette
  * @param mapBytes    of albedo, and of normals
  * @param planes      entries of the plane table
  * @param planeBytes  of the plane map, its table and the bounding planes
  * @param boundingPlanes bounding planes outside the view
  * @param columnsPerCopy consecutive columns that read one copy of the maps; 1: each column has its own
  */
final case class PhysicalAttributeMemoryConfig(
    width:          Int = 640,
    height:         Int = 480,
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
