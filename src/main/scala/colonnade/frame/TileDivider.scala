package colonnade.frame

import chisel3._
import chisel3.util.Decoupled
import colonnade.config.ColonnadeConfig
import colonnade.formats.FrameSettings

/** Ports of [[TileDivider]]. */
final class TileDividerIO(config: ColonnadeConfig) extends Bundle {
  val frame = Input(new FrameSettings(config.numbers))

  /** Off: tiles pass as they are. */
  val divides = Input(Bool())
  val tiles   = Flipped(Decoupled(new ObjectTile(config)))
  val parts   = Decoupled(new ObjectTile(config))
}

/** Divides a tile into its quarters, in Morton order, without those outside the frame. So work that is much in few tiles is
  * shared by more columns.
  *
  * Throughput: a quarter per cycle. Combinational.
  */
final class TileDivider(config: ColonnadeConfig) extends Module {
  val io = IO(new TileDividerIO(config))

  private val part     = RegInit(0.U(2.W))
  private val isLast   = !io.divides || part === 3.U
  private val isInside = io.parts.bits.x < io.frame.pixelsWide && io.parts.bits.y < io.frame.pixelsHigh
  private val steps    = io.tiles.valid && (io.parts.ready || !isInside)
  when(steps) { part := Mux(isLast, 0.U, part + 1.U) }

  io.parts.valid  := io.tiles.valid && isInside
  io.parts.bits   := io.tiles.bits
  io.parts.bits.x := io.tiles.bits.x | part(0) << Tile.pixelLevels(config) - 1
  io.parts.bits.y := io.tiles.bits.y | part(1) << Tile.pixelLevels(config) - 1
  io.tiles.ready  := steps && isLast
}
