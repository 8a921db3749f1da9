package colonnade.frame

import chisel3._
import chisel3.util.{Decoupled, RegEnable}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameSettings, PixelPosition}

final class TileScanIO(config: ColonnadeConfig) extends Bundle {
  val frame     = Input(new FrameSettings(config.numbers))
  val isDivided = Input(Bool())  // tiles are squares of a [[TileDivider]]
  val tiles     = Flipped(Decoupled(new Tile(config)))
  val positions = Decoupled(new PixelPosition(config))
  val isIdle    = Output(Bool()) // no pixel is left
}

/** The pixels of a tile, clipped at the frame's edge, in Morton order.
  *
  * Throughput: one pixel per cycle. The next tile is accepted with the last pixel of the current one, so tiles follow each
  * other without a gap.
  */
final class TileScan(config: ColonnadeConfig) extends Module {
  val io = IO(new TileScanIO(config))

  private val scan = Module(new MortonScan(Tile.pixelLevels(config)))
  private val tile = RegEnable(io.tiles.bits, io.tiles.fire)

  scan.io.size.valid     := io.tiles.valid
  scan.io.size.bits.wide := clipped(io.frame.pixelsWide, io.tiles.bits.x)
  scan.io.size.bits.high := clipped(io.frame.pixelsHigh, io.tiles.bits.y)
  io.tiles.ready         := scan.io.size.ready

  io.positions.valid  := scan.io.cells.valid
  io.positions.bits.x := tile.x | scan.io.cells.bits.x
  io.positions.bits.y := tile.y | scan.io.cells.bits.y
  scan.io.cells.ready := io.positions.ready
  io.isIdle           := scan.io.isIdle

  /** The size of a tile in one direction. */
  private def clipped(frame: UInt, first: UInt): UInt = {
    val size = Mux(io.isDivided, TileDivider.edge(config).U, config.frame.tileSize.U)
    val left = frame - first
    Mux(left < size, left, size)
  }
}
