package colonnade.frame

import chisel3._
import chisel3.util.{Decoupled, Queue, RegEnable}
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

/** Hands the pixels of a tile, clipped at the frame's edge, in Morton order to whichever render unit is ready, in turn.
  *
  * One pixel a cycle, the first one three cycles after its tile is taken. A slot in front of each render unit holds its
  * next pixel. The next tile is taken when no more than these and two pixels of this one are left, so that tiles follow
  * each other without a gap and no column hoards them.
  */
final class TileWalker(config: ColonnadeConfig) extends Module {
  val io = IO(new TileWalkerIO(config))

  private val scan      = Module(new MortonScan(Tile.pixelLevels(config)))
  private val dispatch  = Module(new Dispatcher(new PixelPosition(config), config.array.rows))
  private val tile      = RegEnable(io.tiles.bits, io.tiles.fire)
  private val positions = Wire(Decoupled(new PixelPosition(config)))

  scan.io.size.valid     := io.tiles.valid
  scan.io.size.bits.wide := clipped(io.frame.pixelsWide, io.tiles.bits.x)
  scan.io.size.bits.high := clipped(io.frame.pixelsHigh, io.tiles.bits.y)
  io.tiles.ready         := scan.io.size.ready

  positions.valid     := scan.io.cells.valid
  positions.bits.x    := tile.x | scan.io.cells.bits.x
  positions.bits.y    := tile.y | scan.io.cells.bits.y
  scan.io.cells.ready := positions.ready

  dispatch.io.items <> Queue(positions, 2)
  io.positions.zip(dispatch.io.takers).foreach { case (position, taker) => position <> Queue(taker, 1, pipe = true) }
  io.isIdle := scan.io.isIdle && !dispatch.io.items.valid && !io.positions.map(_.valid).reduce(_ || _)

  /** Pixels of a tile in one direction. */
  private def clipped(frame: UInt, first: UInt): UInt = {
    val size = config.frame.tileSize.U
    val left = frame - first
    Mux(left < size, left, size)
  }
}
