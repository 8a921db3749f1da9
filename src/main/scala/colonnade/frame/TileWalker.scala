package colonnade.frame

import chisel3._
import chisel3.util.{Decoupled, DecoupledIO, Queue, RegEnable}
import colonnade.common.Dispatcher
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameSettings, PixelPosition, UnitPosition}

/** Ports of [[TileWalker]]. */
final class TileWalkerIO(config: ColonnadeConfig) extends Bundle {
  val frame = Input(new FrameSettings(config.numbers))
  val tiles = Flipped(Decoupled(new ObjectTile(config)))

  /** Pixels of another tile, which shows the environment only. */
  val environment = Option.when(config.hasEnvironment)(Flipped(Decoupled(new PixelPosition(config))))

  /** A pixel of `environment` has left the column. */
  val environmentLeaves = Input(Bool())

  /** Pixels to render, by render unit. */
  val positions = Vec(config.array.rows, Decoupled(new UnitPosition(config)))

  /** Render units get the pixels of this window, too. */
  val window = Input(new EnvironmentWindow(config))

  /** Pixels that show the background. */
  val others = Decoupled(new PixelPosition(config))

  /** No pixel is left. */
  val isIdle = Output(Bool())
}

/** Dispatches the pixels of a tile in the order of [[TileScan]]: those that may show the object or the environment to ready
  * render units, round-robin; the others to the background walker. With an environment a [[PixelMixer]] mixes them with
  * pixels of another tile.
  *
  * Throughput: one pixel per cycle, the first one four cycles after its tile is accepted. A queue of one entry before each
  * render unit holds its next pixel. The next tile is accepted when only these and two more pixels are left, so tiles
  * follow each other without a gap, and no column takes tiles early.
  *
  * @param mostEnvironment
  *   `most` of [[PixelMixer]]
  */
final class TileWalker(config: ColonnadeConfig, mostEnvironment: Option[Int] = None) extends Module {
  val io = IO(new TileWalkerIO(config))

  private val scan     = Module(new TileScan(config, isQueued = false)) // its tile is that of `edgeValues`
  private val outline  = Module(new PixelTest(config))
  private val dispatch = Module(new Dispatcher(new UnitPosition(config), config.array.rows))

  scan.io.frame        := io.frame
  scan.io.isDivided    := TileScheduler.divides(io.window)
  scan.io.tiles.valid  := io.tiles.valid
  scan.io.tiles.bits.x := io.tiles.bits.x
  scan.io.tiles.bits.y := io.tiles.bits.y
  io.tiles.ready       := scan.io.tiles.ready
  outline.io.frame     := io.frame
  outline.io.window    := io.window
  outline.io.pixels <> scan.io.positions
  outline.io.edgeValues := RegEnable(io.tiles.bits.edgeValues, io.tiles.fire)

  private val tested   = if (config.units.shortPaths) Queue(outline.io.tested, 2) else outline.io.tested
  private val forUnits = tested.bits.isForUnits
  private val taken    = Wire(Decoupled(new UnitPosition(config)))
  taken.valid  := tested.valid && forUnits
  taken.bits.x := tested.bits.first.x
  taken.bits.y := tested.bits.first.y
  taken.bits.meetsObject.foreach(_ := tested.bits.meetsObject)
  taken.bits.inObjectTile.foreach(_ := true.B)
  io.others.valid := tested.valid && !forUnits
  io.others.bits  := tested.bits.first
  tested.ready    := Mux(forUnits, taken.ready, io.others.ready)

  dispatch.io.items :<>= io.environment.fold(taken) { environment =>
    val mixer = Module(new PixelMixer(config, mostEnvironment)).io
    mixer.objects :<>= taken
    mixer.environment :<>= environment
    mixer.leaves := io.environmentLeaves
    mixer.positions
  }

  private def queued(taker: DecoupledIO[UnitPosition]): DecoupledIO[UnitPosition] =
    if (config.units.shortPaths) Queue(taker, 2) else Queue(taker, 1, pipe = true)
  io.positions.zip(dispatch.io.takers).foreach { case (position, taker) => position <> queued(taker) }
  io.isIdle := scan.io.isIdle && outline.io.isIdle && !tested.valid && !io.positions.map(_.valid).reduce(_ || _)
}
