package colonnade.frame

import chisel3._
import chisel3.util.{Cat, Decoupled, Queue}
import colonnade.common.Dispatcher
import colonnade.config.ColonnadeConfig
import colonnade.formats.FrameSettings

/** Ports of [[TileDealer]]. */
final class TileDealerIO(config: ColonnadeConfig) extends Bundle {
  val frame = Input(new FrameSettings(config.numbers))

  /** Tiles that meet it count as those that meet the object. */
  val window = Input(new RoomWindow(config))

  /** Deals the tiles of a frame; only while idle. */
  val start = Input(Bool())

  /** Valid only where ready is set, see [[Dispatcher]]. */
  val tiles = Vec(config.array.columns, Decoupled(new Tile(config)))

  /** No tile is left. */
  val isIdle = Output(Bool())
}

/** Hands the tiles of a frame in Morton order to whichever column is ready, in turn: those that meet the object, or the
  * others.
  *
  * One tile a cycle while the queue lasts, the first one four cycles after the start. Codes outside the frame are skipped
  * ahead of need: skipping between two tiles takes fewer cycles than a column has pixels in one. A tile of the other kind
  * takes one cycle.
  */
final class TileDealer(config: ColonnadeConfig, ofObject: Boolean) extends Module {
  import TileDealer._

  val io = IO(new TileDealerIO(config))

  private val coordinateBits = config.numbers.coordinateBits
  private val pixelLevels    = Tile.pixelLevels(config)
  private val scan           = Module(new MortonScan(Tile.tileLevels(config)))
  private val outline        = Module(new OutlineTest(config, config.frame.tileSize))
  private val dispatch       = Module(new Dispatcher(new Tile(config), config.array.columns))
  private val tiles          = Wire(Decoupled(new Tile(config)))

  scan.io.size.valid     := io.start
  scan.io.size.bits.wide := tilesIn(io.frame.pixelsWide)
  scan.io.size.bits.high := tilesIn(io.frame.pixelsHigh)

  outline.io.frame          := io.frame
  outline.io.window         := io.window
  outline.io.squares.valid  := scan.io.cells.valid
  outline.io.squares.bits.x := firstPixel(scan.io.cells.bits.x)
  outline.io.squares.bits.y := firstPixel(scan.io.cells.bits.y)
  scan.io.cells.ready       := outline.io.squares.ready

  private val tested  = outline.io.tested
  private val isMeant = tested.bits.isForUnits === ofObject.B
  tiles.valid  := tested.valid && isMeant
  tiles.bits.x := tested.bits.first.x
  tiles.bits.y := tested.bits.first.y
  tested.ready := tiles.ready || !isMeant

  dispatch.io.items <> Queue(tiles, queueEntries)
  io.tiles <> dispatch.io.takers
  io.isIdle := scan.io.isIdle && outline.io.isIdle && !dispatch.io.items.valid

  private def tilesIn(pixels: UInt): UInt = (pixels +& (config.frame.tileSize - 1).U) >> pixelLevels

  /** The bits above a coordinate's are zero, for a tile begins inside the frame. */
  private def firstPixel(cell: UInt): UInt = Cat(cell, 0.U(pixelLevels.W)).pad(coordinateBits)(coordinateBits - 1, 0)
}

object TileDealer {
  private val queueEntries = 4
}
