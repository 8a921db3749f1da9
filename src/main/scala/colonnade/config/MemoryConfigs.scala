package colonnade.config

/** How the maps of albedo and normals are stored. */
sealed abstract class MapEncoding(val name: String)

object MapEncoding {

  /** Each tile has a mode: two or four palette entries, and the size of the cells that select one of them. */
  object TwoLevel extends MapEncoding("twoLevel")

  /** SLIC superpixels: a tile has one seed, and the label of a block of pixels selects one of the nine nearest seeds.
    */
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
  * @param columnsPerCopy columns that read one copy of the maps (docs/attributes.md#copies); more than the array has:
  *                       all
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

/** Caches between traversal units and a scene in DRAM: one in every column, and one that all columns share. A line is
  * two records. Pairs of lines are interleaved over `columnBvhMemory.banks` banks in both.
  *
  * @param lines        lines of a column's cache: a power of two, at most 4,096, for each way and bank
  * @param ways         ways of a column's cache
  * @param misses       lines that a column awaits; a multiple of the banks
  * @param sharedLines  lines of the shared cache, as `lines`; 0: no shared cache
  * @param sharedWays   ways of the shared cache, at most 16; 0 without one
  * @param sharedMisses lines awaited from DRAM; a multiple of the banks
  * @param busBytes     bytes of the DRAM port; 4 without a shared cache
  * @param parity       each record has a parity bit from the DRAM port to the requesters
  */
final case class SceneCacheConfig(
    lines:        Int = 512,
    ways:         Int = 4,
    misses:       Int = 8,
    sharedLines:  Int = 0,
    sharedWays:   Int = 0,
    sharedMisses: Int = 8,
    busBytes:     Int = 4,
    parity:       Boolean = false
) {
  Require.within("columnBvhMemory.cache.ways", ways, 1, 16)
  Require.within(
    "columnBvhMemory.cache.sharedWays",
    sharedWays,
    if (hasSharedCache) 1 else 0,
    if (hasSharedCache) 16 else 0
  )
  Require.within("columnBvhMemory.cache.misses", misses, 1, 64)
  Require.within("columnBvhMemory.cache.sharedMisses", sharedMisses, 1, 256)
  Require.oneOf("columnBvhMemory.cache.busBytes", busBytes, Seq(4, 8, 16, 32, 64, 128))
  Require("columnBvhMemory.cache.sharedLines", hasSharedCache || busBytes == 4, "must not be 0, unless busBytes is 4")

  def hasSharedCache: Boolean = sharedLines != 0

  /** Sets of a bank of the column's cache. */
  def sets(banks: Int): Int = lines / (banks * ways)

  /** Sets of a bank of the shared cache. */
  def sharedSets(banks: Int): Int = sharedLines / (banks * sharedWays)

  /** Checks it against the column memory that it is part of. */
  private[config] def check(memory: ColumnBvhMemoryConfig): Unit = {
    import memory.banks
    powerOfTwoSets("lines", lines, ways, banks)
    if (hasSharedCache) powerOfTwoSets("sharedLines", sharedLines, sharedWays, banks)
    multiple("misses", misses, banks)
    multiple("sharedMisses", sharedMisses, banks)
    Require(
      "columnBvhMemory.depth",
      memory.depth >= SceneCacheConfig.leastDepth,
      s"is ${memory.depth}, but must be at least ${SceneCacheConfig.leastDepth} with a cache"
    )
    Require("columnBvhMemory.snooping", memory.snooping, "must be true with a cache")
    Require("columnBvhMemory.readLatency", memory.readLatency == 1, "must be 1 with a cache")
    Require("columnBvhMemory.holdable", !memory.holdable, "must be false with a cache")
  }

  private def powerOfTwoSets(key: String, lines: Int, ways: Int, banks: Int): Unit = {
    val sets = lines / (ways * banks)
    Require(
      s"columnBvhMemory.cache.$key",
      lines > 0 && lines == sets * ways * banks && (sets & (sets - 1)) == 0 && sets <= (1 << 12),
      s"is $lines, but must be a power of two, at most 4096, times $ways ways and $banks banks"
    )
  }

  private def multiple(key: String, misses: Int, banks: Int): Unit =
    Require(s"columnBvhMemory.cache.$key", misses % banks == 0, s"is $misses, but must be a multiple of $banks banks")
}

object SceneCacheConfig {
  val lineRecords: Int = 2 // records of a line

  /** Records of the smallest scene memory: a pair of lines in each of four banks, twice. */
  val leastDepth: Int = 32
}
