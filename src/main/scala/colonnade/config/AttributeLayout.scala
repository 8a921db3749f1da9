package colonnade.config

/** Sizes of the parts of the physical-attribute memory. `formats.AttributeRecords` defines the words.
  *
  * A two-level map and the plane map have a descriptor per tile. The bytes that the fixed parts leave are their heap,
  * to which descriptors point. A SLIC map has a seed per tile and a label per block; it takes what these need.
  */
final case class AttributeLayout(config: PhysicalAttributeMemoryConfig) extends TileGrid {
  import AttributeLayout._
  import config._

  val mapWidth:  Int = width
  val mapHeight: Int = height

  /** Log2 of a tile's edge. */
  val tileLog:     Int = log2(tileSize)
  val tileColumns: Int = (width + tileSize - 1) / tileSize
  val tileRows:    Int = (height + tileSize - 1) / tileSize
  val tiles:       Int = tileColumns * tileRows

  /** Log2 of the edge of a block, whose pixels share a SLIC label. */
  val blockLog:     Int = tileLog - log2(blocksPerTileEdge)
  val blockColumns: Int = (width + (1 << blockLog) - 1) >> blockLog

  /** Heap words that hold the labels of all blocks, row by row. */
  val labelWords: Int = {
    val blockRows = (height + (1 << blockLog) - 1) >> blockLog
    (blockColumns * blockRows * labelBits + heapWordBits - 1) / heapWordBits
  }

  val xBits:                  Int = bitsOf(width)
  val yBits:                  Int = bitsOf(height)
  val tileBits:               Int = bitsOf(tiles)
  val paletteBits:            Int = bitsOf(paletteSize)
  val planeIdBits:            Int = bitsOf(planes)
  val boundingPlaneIndexBits: Int = bitsOf(boundingPlanes)
  val tableIndexBits:         Int = planeIdBits.max(boundingPlaneIndexBits)

  /** Heap words of a two-level map of albedo, and of normals; 0 for SLIC maps. */
  val mapHeapWords: Int = encoding match {
    case MapEncoding.TwoLevel =>
      val (descriptors, palette) = (tiles * mapDescriptorBits / 8, bytes(paletteSize * entryBits))
      heapWords(
        "mapBytes",
        mapBytes,
        descriptors + palette,
        s"$tiles tile descriptors take $descriptors bytes and $paletteSize palette entries $palette",
        largestTile = 1 + 2 * (1 << 8) / heapWordBits
      )
    case MapEncoding.Slic =>
      val (seeds, labels) = (bytes(tiles * entryBits), labelWords * heapWordBits / 8)
      atLeast("mapBytes", mapBytes, seeds + labels, s"$tiles seeds take $seeds bytes and the labels of blocks $labels")
      0
  }

  val planeHeapWords: Int = {
    val descriptors       = tiles * planeDescriptorBits / 8
    val (table, bounding) = (planes * planeBits / 8, boundingPlanes * boundingPlaneEntryBytes)
    heapWords(
      "planeBytes",
      planeBytes,
      descriptors + table + bounding,
      s"$tiles tile descriptors take $descriptors bytes, $planes planes $table and $boundingPlanes bounding planes $bounding",
      largestTile = 2 + 2 * (1 << 8) / heapWordBits
    )
  }

  /** All values by their manifest key. A SLIC map has labels in place of palette and heap. */
  def entries: Seq[(String, Int)] = {
    val ofMaps = encoding match {
      case MapEncoding.TwoLevel => Seq("paletteSize" -> paletteSize, "mapHeapWords" -> mapHeapWords)
      case MapEncoding.Slic => Seq("blockLog" -> blockLog, "blockColumns" -> blockColumns, "labelWords" -> labelWords)
    }
    Seq(
      "width"       -> width,
      "height"      -> height,
      "tileLog"     -> tileLog,
      "tileColumns" -> tileColumns,
      "tileRows"    -> tileRows
    ) ++ ofMaps ++ Seq(
      "mapBytes"       -> mapBytes,
      "planes"         -> planes,
      "planeHeapWords" -> planeHeapWords,
      "planeBytes"     -> planeBytes,
      "boundingPlanes" -> boundingPlanes
    )
  }

  /** Heap words in the remaining bytes.
    *
    * @param largestTile words of the finest mode
    */
  private def heapWords(field: String, all: Int, fixed: Int, because: String, largestTile: Int): Int = {
    def bytesOf(words: Int): Int = words * heapWordBits / 8
    val max                      = fixed + bytesOf(1 << pointerBits)
    atLeast(field, all, fixed + bytesOf(largestTile), s"$because, the finest tile ${bytesOf(largestTile)}")
    if (all > max)
      refuse(field, all, s"at most $max: $because, and tiles reach ${bytesOf(1 << pointerBits)} more")
    (all - fixed) / bytesOf(1)
  }

  private def atLeast(field: String, all: Int, min: Int, because: String): Unit =
    if (all < min) refuse(field, all, s"at least $min: $because")

  private def refuse(field: String, all: Int, rule: String): Nothing =
    throw new ConfigError(s"${PhysicalAttributeMemoryConfig.section}.$field is $all; it must be $rule")
}

object AttributeLayout {

  /** The layout of a configuration with the memory. */
  def of(config: ColonnadeConfig): AttributeLayout = config.physicalAttributeMemory match {
    case Some(memory) => memory.layout
    case None         => throw new ConfigError("physicalAttributeMemory is null; a unit of the background needs it")
  }

  val heapWordBits: Int = 16

  /** Width of a heap word; a word also holds the mask of a tile's coarsest mode, or the plane id of a flat tile. */
  val pointerBits: Int = 13
  val modeBits:    Int = 3

  val indexBits:     Int = 8  // width of a stored index into a palette or into the plane table
  val componentBits: Int = 12 // width of a component of a palette entry or of a seed
  val entryBits:     Int = 3 * componentBits

  val labelBits: Int = 4 // width of a SLIC label: one of nine seeds

  val mapDescriptorBits:   Int = modeBits + pointerBits + 2 * indexBits
  val planeDescriptorBits: Int = modeBits + pointerBits

  val coefficientBits: Int = 20
  val exponentBits:    Int = 4 // of the exponent that the coefficients of a plane share
  val planeBits:       Int = 3 * coefficientBits + exponentBits

  /** Size of a bounding plane, rounded up to heap words. */
  val boundingPlaneEntryBytes: Int = (planeBits + 2 * entryBits + heapWordBits - 1) / heapWordBits * (heapWordBits / 8)

  private val blocksPerTileEdge = 4

  private def bytes(bits: Int): Int = (bits + 7) / 8

  private def log2(power: Int): Int = Integer.numberOfTrailingZeros(power)

  /** Width of an index to this many items; at least 1. */
  private def bitsOf(count: Int): Int = NumberFormats.bitLength(count - 1).max(1)
}

/** Sizes of the texture memory: a two-level map of one square atlas, which holds all textures of a scene.
  *
  * @param bytes descriptors, palette and heap; the heap takes what the other two leave
  */
final case class TextureLayout(bytes: Int) extends TileGrid {
  import AttributeLayout.{entryBits, heapWordBits, mapDescriptorBits, pointerBits}

  val mapWidth:    Int = TextureLayout.edge
  val mapHeight:   Int = TextureLayout.edge
  val tileLog:     Int = 4
  val tileColumns: Int = mapWidth >> tileLog
  val tiles:       Int = tileColumns * tileColumns
  val paletteSize: Int = 256
  val xBits:       Int = NumberFormats.bitLength(mapWidth - 1)
  val yBits:       Int = NumberFormats.bitLength(mapHeight - 1)
  val tileBits:    Int = NumberFormats.bitLength(tiles - 1)
  val paletteBits: Int = NumberFormats.bitLength(paletteSize - 1)

  private val fixedBytes = tiles * mapDescriptorBits / 8 + paletteSize * entryBits / 8

  /** One tile in the finest mode; all that pointers reach. */
  private val (leastHeap, maxHeap) = (66, (1 << pointerBits) * heapWordBits / 8)
  Require.within("geometry.textureBytes", bytes, fixedBytes + leastHeap, fixedBytes + maxHeap, orElse = "0, or ")

  val heapWords: Int = (bytes - fixedBytes) * 8 / heapWordBits

  /** Fraction bits of a corner's coordinate: it has as many bits as a channel of a colour. */
  val fractionBits: Int = NumberFormats.colourBits - xBits

  /** All values by their manifest key. */
  def entries: Seq[(String, Int)] = Seq(
    "width"        -> mapWidth,
    "height"       -> mapHeight,
    "tileLog"      -> tileLog,
    "tileColumns"  -> tileColumns,
    "tileRows"     -> tileColumns,
    "paletteSize"  -> paletteSize,
    "mapHeapWords" -> heapWords,
    "mapBytes"     -> bytes,
    "fractionBits" -> fractionBits
  )
}

object TextureLayout {
  val edge: Int = 512 // edge of the atlas, texels

  /** The layout of a configuration with textures. */
  def of(config: ColonnadeConfig): TextureLayout =
    config.geometry.texture.getOrElse(throw new ConfigError("geometry.textureBytes is 0; a unit of textures needs it"))
}

/** A map in square tiles, row by row, whose pixels are entries of a palette. */
trait TileGrid {

  /** Size of the map, pixels. */
  def mapWidth: Int
  def mapHeight: Int

  /** Log2 of a tile's edge. */
  def tileLog: Int
  def tileColumns: Int
  def tiles: Int

  /** Widths of a pixel's coordinates, of a tile's number and of a palette index. */
  def xBits: Int
  def yBits: Int
  def tileBits: Int
  def paletteBits: Int
}
