package colonnade.frame

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled}
import colonnade.config.ColonnadeConfig
import colonnade.formats.FrameSettings

final class TileDividerIO(config: ColonnadeConfig) extends Bundle {
  val frame   = Input(new FrameSettings(config.numbers))
  val divides = Input(Bool()) // off: tiles pass as they are
  val tiles   = Flipped(Decoupled(new ObjectTile(config)))
  val parts   = Decoupled(new ObjectTile(config))
}

/** Divides a tile into squares of [[TileDivider.edge]], in Morton order, without those outside the frame. So work that is
  * much in few tiles is shared by more columns.
  *
  * Throughput: a square per cycle. Combinational.
  */
final class TileDivider(config: ColonnadeConfig) extends Module {
  val io = IO(new TileDividerIO(config))

  private val levels   = Tile.pixelLevels(config) - log2Ceil(TileDivider.edge(config))
  private val part     = RegInit(0.U((2 * levels).W))
  private val isLast   = !io.divides || part.andR
  private val isInside = io.parts.bits.x < io.frame.pixelsWide && io.parts.bits.y < io.frame.pixelsHigh
  private val steps    = io.tiles.valid && (io.parts.ready || !isInside)
  when(steps) { part := Mux(isLast, 0.U, part + 1.U) }

  io.parts.valid  := io.tiles.valid && isInside
  io.parts.bits   := io.tiles.bits
  io.parts.bits.x := io.tiles.bits.x | (coordinate(0) << log2Ceil(TileDivider.edge(config)))
  io.parts.bits.y := io.tiles.bits.y | (coordinate(1) << log2Ceil(TileDivider.edge(config)))
  io.tiles.ready  := steps && isLast

  private def coordinate(axis: Int): UInt = Cat((0 until levels).reverse.map(level => part(2 * level + axis)))
}

object TileDivider {

  /** Of the squares that a tile is divided into, in pixels. */
  def edge(config: ColonnadeConfig): Int = config.frame.tileSize / 4
}
