package colonnade.config

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
