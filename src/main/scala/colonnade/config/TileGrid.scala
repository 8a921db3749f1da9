package colonnade.config

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
