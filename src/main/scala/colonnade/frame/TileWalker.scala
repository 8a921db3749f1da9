package colonnade.frame

import chisel3._
import chisel3.util.{Decoupled, Queue, RegEnable}
import colonnade.common.TimingSlice
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameSettings, PixelPosition, UnitPosition}

final class TileWalkerIO(config: ColonnadeConfig) extends Bundle {
  val frame = Input(new FrameSettings(config.numbers))
  val tiles = Flipped(Decoupled(new ObjectTile(config)))

  /** Pixels of another tile, which shows the environment only; one of them has left the column. */
  val environment       = Option.when(config.hasEnvironment)(Flipped(Decoupled(new PixelPosition(config))))
  val environmentLeaves = Input(Bool())

  /** Pixels to render, with the window's. */
  val positions = Decoupled(new UnitPosition(config))
  val window    = Input(new EnvironmentWindow(config))

  val others = Decoupled(new PixelPosition(config)) // pixels that show the background
  val isIdle = Output(Bool())                       // no pixel is left
}

/** Sorts the pixels of a tile, in the order of [[TileScan]]: pixels that may show object or environment are rendered,
  * the others go to the background walker. With an environment a [[PixelMixer]] mixes them with pixels of another tile.
  *
  * Throughput: one pixel per cycle, the first one five cycles after its tile is accepted. Of the others
  * [[TileWalker.maxOthers]] wait in a queue, so that they do not hold up those behind them. The next tile is accepted when
  * only the queues and two more pixels are left, so tiles follow each other without a gap, and no column takes tiles early.
  */
final class TileWalker(config: ColonnadeConfig) extends Module {
  val io = IO(new TileWalkerIO(config))

  private val scan    = Module(new TileScan(config))
  private val outline = Module(new PixelTest(config))

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

  private val tested   = TimingSlice.queue(outline.io.tested)
  private val forUnits = tested.bits.isForUnits
  private val taken    = Wire(Decoupled(new UnitPosition(config)))
  taken.valid  := tested.valid && forUnits
  taken.bits.x := tested.bits.first.x
  taken.bits.y := tested.bits.first.y
  taken.bits.meetsObject.foreach(_ := tested.bits.meetsObject)
  taken.bits.inObjectTile.foreach(_ := true.B)
  private val others = Module(new Queue(new PixelPosition(config), TileWalker.maxOthers, useSyncReadMem = true)).io
  others.enq.valid := tested.valid && !forUnits
  others.enq.bits  := tested.bits.first
  tested.ready     := Mux(forUnits, taken.ready, others.enq.ready)
  io.others :<>= others.deq

  private val positions = io.environment.fold(taken) { environment =>
    val mixer = Module(new PixelMixer(config, TileWalker.maxEnvironment(config))).io
    mixer.objects :<>= taken
    mixer.environment :<>= environment
    mixer.leaves := io.environmentLeaves
    mixer.positions
  }

  io.positions :<>= Queue(positions, 1, pipe = true) // one pixel at most is chosen before a context is free
  io.isIdle := scan.io.isIdle && outline.io.isIdle && !tested.valid && !io.others.valid && !io.positions.valid
}

object TileWalker {
  val maxOthers: Int = 64 // pixels outside the object that wait for the background walker

  /** Pixels of a tile of the environment that are in flight at most: one enters in four cycles, and leaves after about 300. */
  def maxEnvironment(config: ColonnadeConfig): Int = (config.units.pathContexts / 2).max(1)
}
