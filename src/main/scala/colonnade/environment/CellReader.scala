package colonnade.environment

import chisel3._
import colonnade.config.AttributeLayout

/** Requests the planes of tiles, and the plane of cells. The next tile or cell of the ray is requested as soon as the
  * current one is known. Illegal responses count if the ray comes to their tile.
  */
final class CellReader(m: MarchOperations, maps: AttributeChannel[CellRequest, CellResponse]) {
  import m.formats.layout

  val channel = new Lookahead(maps, (response: TaggedResponse[CellResponse]) => response)

  /** A response that is taken in this cycle is illegal. */
  val isIllegal: Bool = WireInit(false.B)

  /** The response that can be taken. */
  val content: CellResponse = channel.response.content

  def isInMap(tile: Seq[UInt]): Bool = tile(0) < layout.tileColumns.U && tile(1) < layout.tileRows.U

  /** Requests all planes of a tile, which is in the map. */
  def requestTile(tile: Seq[UInt]): Unit = channel.make { (request: CellRequest) =>
    request.pixel     := CellReader.corner(layout, tile)
    request.wholeTile := true.B
  }

  /** Requests the plane of a pixel's cell. */
  def requestCell(pixel: MapPixel): Unit = channel.make { (request: CellRequest) =>
    request.pixel     := pixel
    request.wholeTile := false.B
  }

  /** Takes the response. */
  def take(): Unit = {
    channel.take()
    isIllegal := channel.response.isIllegal
  }
}

private[environment] object CellReader {

  /** A tile's first pixel. */
  def corner(layout: AttributeLayout, tile: Seq[UInt]): MapPixel =
    pixel(layout, tile.map(tile => (tile << layout.tileLog).asUInt))

  def pixel(layout: AttributeLayout, position: Seq[UInt]): MapPixel = {
    val pixel = Wire(new MapPixel(layout))
    pixel.x := position(0)
    pixel.y := position(1)
    pixel
  }
}
