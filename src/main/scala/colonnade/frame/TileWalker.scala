package colonnade.frame

import chisel3._
import chisel3.util.{Decoupled, Queue}
import colonnade.config.ColonnadeConfig
import colonnade.formats.FrameSettings
import colonnade.unit.PixelPosition

/** Ports of [[TileWalker]]. */
final class TileWalkerIO(config: ColonnadeConfig) extends Bundle {
  val frame = Input(new FrameSettings(config.numbers))
  val tiles = Flipped(Decoupled(new Tile(config)))

  val positions = Vec(config.array.rows, Decoupled(new PixelPosition(config)))

  /** No pixel is left to hand out. */
  val isIdle = Output(Bool())
}

/** Hands the pixels of a tile, in the order of [[TileScan]], to whichever render unit is ready, in turn.
  *
  * One pixel a cycle, the first one three cycles after its tile is taken. A slot in front of each render unit holds its
  * next pixel. The next tile is taken when no more than these and two pixels of this one are left, so that tiles follow
  * each other without a gap and no column hoards them.
  */
final class TileWalker(config: ColonnadeConfig) extends Module {
  val io = IO(new TileWalkerIO(config))

  private val scan     = Module(new TileScan(config))
  private val dispatch = Module(new Dispatcher(new PixelPosition(config), config.array.rows))

  scan.io.frame := io.frame
  scan.io.tiles <> io.tiles
  dispatch.io.items <> Queue(scan.io.positions, 2)
  io.positions.zip(dispatch.io.takers).foreach { case (position, taker) => position <> Queue(taker, 1, pipe = true) }
  io.isIdle := scan.io.isIdle && !dispatch.io.items.valid && !io.positions.map(_.valid).reduce(_ || _)
}
