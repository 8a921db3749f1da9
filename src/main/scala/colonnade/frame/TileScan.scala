package colonnade.frame

import chisel3._
import chisel3.util.{Decoupled, Queue, RegEnable}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameSettings, PixelPosition}

/** Ports of [[TileScan]]. */
final class TileScanIO(config: ColonnadeConfig) extends Bundle {
  val frame = Input(new FrameSettings(config.numbers))

  /** Tiles are quarters of a tile. */
  val isDivided = Input(Bool())
  val tiles     = Flipped(Decoupled(new Tile(config)))
  val positions = Decoupled(new PixelPosition(config))

  /** No pixel is left. */
  val isIdle = Output(Bool())
}

/** The pixels of a tile, clipped at the frame's edge, in Morton order.
  *
  * Throughput: one pixel per cycle. The next tile is accepted with the last pixel of the current one, so tiles follow each
  * other without a gap.
  *
  * @param isQueued
  *   pixels wait in a queue: then those of a tile may leave after the next tile is accepted
  */
final class TileScan(config: ColonnadeConfig, isQueued: Boolean) extends Module {
  val io = IO(new TileScanIO(config))

  private val scan = Module(new MortonScan(Tile.pixelLevels(config)))
  private val tile = RegEnable(io.tiles.bits, io.tiles.fire)

  scan.io.size.valid     := io.tiles.valid
  scan.io.size.bits.wide := clipped(io.frame.pixelsWide, io.tiles.bits.x)
  scan.io.size.bits.high := clipped(io.frame.pixelsHigh, io.tiles.bits.y)
  io.tiles.ready         := scan.io.size.ready

  private val positions = if (isQueued) Wire(chiselTypeOf(io.positions)) else io.positions
  positions.valid     := scan.io.cells.valid
  positions.bits.x    := tile.x | scan.io.cells.bits.x
  positions.bits.y    := tile.y | scan.io.cells.bits.y
  scan.io.cells.ready := positions.ready
  if (isQueued) {
    io.positions <> Queue(positions, 2)
    io.isIdle := scan.io.isIdle && !io.positions.valid
  } else {
    io.isIdle := scan.io.isIdle
  }

  /** The size of a tile in one direction. */
  private def clipped(frame: UInt, first: UInt): UInt = {
    val size = Mux(io.isDivided, (config.frame.tileSize / 2).U, config.frame.tileSize.U)
    val left = frame - first
    Mux(left < size, left, size)
  }
}
