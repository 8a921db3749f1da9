package colonnade.frame

import chisel3._
import chisel3.util.{Cat, Decoupled, Queue}
import colonnade.config.ColonnadeConfig
import colonnade.formats.FrameSettings

/** Ports of [[TileDealer]]. */
final class TileDealerIO(config: ColonnadeConfig) extends Bundle {
  val frame = Input(new FrameSettings(config.numbers))

  /** Deals the tiles of a frame; only while idle. */
  val start = Input(Bool())

  /** Valid only where ready is set, see [[Dispatcher]]. */
  val tiles = Vec(config.array.columns, Decoupled(new Tile(config)))

  /** No tile is left. */
  val isIdle = Output(Bool())
}

/** Hands the tiles of a frame in Morton order to whichever column is ready, in turn: those that meet the object's
  * rectangle, or the others.
  *
  * One tile a cycle while the queue lasts, the first one two cycles after the start. Codes outside the frame are skipped
  * ahead of need: skipping between two tiles takes fewer cycles than a column has pixels in one. A tile of the other kind
  * takes one cycle.
  */
final class TileDealer(config: ColonnadeConfig, ofObject: Boolean) extends Module {
  import TileDealer._

  val io = IO(new TileDealerIO(config))

  private val coordinateBits = config.numbers.coordinateBits
  private val pixelLevels    = Tile.pixelLevels(config)
  private val scan           = Module(new MortonScan(Tile.tileLevels(config)))
  private val dispatch       = Module(new Dispatcher(new Tile(config), config.array.columns))
  private val tiles          = Wire(Decoupled(new Tile(config)))

  scan.io.size.valid     := io.start
  scan.io.size.bits.wide := tilesIn(io.frame.pixelsWide)
  scan.io.size.bits.high := tilesIn(io.frame.pixelsHigh)

  private val isMeant = meetsObject(tiles.bits) === ofObject.B
  tiles.valid         := scan.io.cells.valid && isMeant
  tiles.bits.x        := firstPixel(scan.io.cells.bits.x)
  tiles.bits.y        := firstPixel(scan.io.cells.bits.y)
  scan.io.cells.ready := tiles.ready || !isMeant

  dispatch.io.items <> Queue(tiles, queueEntries)
  io.tiles <> dispatch.io.takers
  io.isIdle := scan.io.isIdle && !dispatch.io.items.valid

  private def meetsObject(tile: Tile): Bool = {
    val rect = io.frame.objectRect
    val size = config.frame.tileSize.U
    rect.x0 < rect.x1 && rect.y0 < rect.y1 && tile.x < rect.x1 && tile.y < rect.y1 &&
    tile.x +& size > rect.x0 && tile.y +& size > rect.y0
  }

  private def tilesIn(pixels: UInt): UInt = (pixels +& (config.frame.tileSize - 1).U) >> pixelLevels

  /** The bits above a coordinate's are zero, for a tile begins inside the frame. */
  private def firstPixel(cell: UInt): UInt = Cat(cell, 0.U(pixelLevels.W)).pad(coordinateBits)(coordinateBits - 1, 0)
}

object TileDealer {
  private val queueEntries = 4
}
