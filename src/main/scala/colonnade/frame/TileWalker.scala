package colonnade.frame

import chisel3._
import chisel3.util.{Decoupled, Queue}
import colonnade.common.Dispatcher
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameSettings, PixelPosition, UnitPosition}

/** Ports of [[TileWalker]]. */
final class TileWalkerIO(config: ColonnadeConfig) extends Bundle {
  val frame = Input(new FrameSettings(config.numbers))
  val tiles = Flipped(Decoupled(new Tile(config)))

  /** Pixels that may see the object, one port for each render unit. */
  val positions = Vec(config.array.rows, Decoupled(new UnitPosition(config)))

  /** Render units get its pixels too. */
  val window = Input(new RoomWindow(config))

  /** Pixels that do not. */
  val others = Decoupled(new PixelPosition(config))

  /** No pixel is left to hand out. */
  val isIdle = Output(Bool())
}

/** Hands the pixels of a tile that may see the object, in the order of [[TileScan]], to whichever render unit is ready,
  * in turn; and the others, in the same order, to whoever draws the background.
  *
  * One pixel a cycle, the first one four cycles after its tile is taken. A slot in front of each render unit holds its
  * next pixel. The next tile is taken when no more than these and two pixels of this one are left, so that tiles follow
  * each other without a gap and no column hoards them.
  */
final class TileWalker(config: ColonnadeConfig) extends Module {
  val io = IO(new TileWalkerIO(config))

  private val scan     = Module(new TileScan(config))
  private val outline  = Module(new OutlineTest(config, size = 1))
  private val dispatch = Module(new Dispatcher(new UnitPosition(config), config.array.rows))

  scan.io.frame := io.frame
  scan.io.tiles <> io.tiles
  outline.io.frame  := io.frame
  outline.io.window := io.window
  outline.io.squares <> scan.io.positions

  private val tested   = outline.io.tested
  private val forUnits = tested.bits.isForUnits
  dispatch.io.items.valid  := tested.valid && forUnits
  dispatch.io.items.bits.x := tested.bits.first.x
  dispatch.io.items.bits.y := tested.bits.first.y
  dispatch.io.items.bits.meetsObject.foreach(_ := tested.bits.meetsObject)
  io.others.valid := tested.valid && !forUnits
  io.others.bits  := tested.bits.first
  tested.ready    := Mux(forUnits, dispatch.io.items.ready, io.others.ready)

  io.positions.zip(dispatch.io.takers).foreach { case (position, taker) => position <> Queue(taker, 1, pipe = true) }
  io.isIdle := scan.io.isIdle && outline.io.isIdle && !io.positions.map(_.valid).reduce(_ || _)
}
