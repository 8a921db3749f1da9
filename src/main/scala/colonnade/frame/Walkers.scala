package colonnade.frame

import chisel3._
import chisel3.util.{Arbiter, Decoupled, Queue, RegEnable}
import colonnade.common.TimingSlice
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameRegisters, FrameSettings, Pixel, PixelHit, PixelPosition, PixelRect, Rgb, UnitPosition}

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
  * [[TileWalker.maxOthers]] wait in a queue, so that they do not hold up those behind them. The next tile is accepted
  * when only the queues and two more pixels are left, so tiles follow each other without a gap, and no column takes
  * tiles early.
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

  /** Pixels of a tile of the environment that are in flight at most: one enters in four cycles, and leaves after about
    * 300.
    */
  def maxEnvironment(config: ColonnadeConfig): Int = (config.units.pathContexts / 2).max(1)
}

final class BackgroundWalkerIO(config: ColonnadeConfig) extends Bundle {
  val frame  = Input(new FrameSettings(config.numbers))
  val colour = Input(Rgb(FrameRegisters.colour))
  val tiles  = Flipped(Decoupled(new Tile(config)))

  /** Background pixels of tiles of other kinds, by priority. */
  val others = Vec(TileKind.all(config).size - 1, Flipped(Decoupled(new PixelPosition(config))))

  /** Pixels of `others`, and of the own tiles. */
  val rejected = Decoupled(new Pixel(config))
  val pixels   = Decoupled(new Pixel(config))

  val isIdle = Output(Bool()) // no pixel of a tile is left
}

/** Colours the pixels that show the background, in parallel with the path tracer: all pixels of its own tiles, and
  * those that the column's [[TileWalker]] and [[EnvironmentWalker]] reject. Throughput: one pixel per cycle of either.
  */
final class BackgroundWalker(config: ColonnadeConfig) extends Module {
  val io = IO(new BackgroundWalkerIO(config))

  private val scan   = Module(new TileScan(config))
  private val others = Module(new Arbiter(new PixelPosition(config), io.others.size))
  scan.io.frame     := io.frame
  scan.io.isDivided := false.B
  scan.io.tiles <> io.tiles
  others.io.in.zip(io.others).foreach { case (in, positions) => in <> positions }

  private val own = TimingSlice.queue(scan.io.positions)
  for ((pixels, positions) <- Seq(io.rejected -> others.io.out, io.pixels -> own)) {
    pixels.valid         := positions.valid
    pixels.bits.x        := positions.bits.x
    pixels.bits.y        := positions.bits.y
    pixels.bits.colour   := io.colour
    pixels.bits.isObject := false.B
    pixels.bits.ratio.foreach(_.channels.foreach(_ := FrameRegisters.one))
    pixels.bits.hit.foreach(_ := 0.U.asTypeOf(new PixelHit(config)))
    positions.ready := pixels.ready
  }
  io.isIdle := scan.io.isIdle && !own.valid
}

final class EnvironmentWalkerIO(config: ColonnadeConfig) extends Bundle {
  val frame  = Input(new FrameSettings(config.numbers))
  val window = Input(new EnvironmentWindow(config))
  val tiles  = Flipped(Decoupled(new Tile(config)))

  /** Pixels that show the environment, and pixels that show the background. */
  val positions = Decoupled(new PixelPosition(config))
  val others    = Decoupled(new PixelPosition(config))

  val isIdle = Output(Bool()) // no pixel of a tile is left
}

/** Walks the tiles that show the environment and not the object, and sorts out their pixels outside the window.
  *
  * Throughput: one pixel per cycle. Combinational behind the queue of its [[TileScan]].
  */
final class EnvironmentWalker(config: ColonnadeConfig) extends Module {
  val io = IO(new EnvironmentWalkerIO(config))

  private val scan = Module(new TileScan(config))
  scan.io.frame     := io.frame
  scan.io.isDivided := false.B
  scan.io.tiles <> io.tiles

  private val position = TimingSlice.queue(scan.io.positions)
  private val inWindow = io.window.meets(position.bits, size = 1)
  position.ready     := Mux(inWindow, io.positions.ready, io.others.ready)
  io.positions.valid := position.valid && inWindow
  io.positions.bits  := position.bits
  io.others.valid    := position.valid && !inWindow
  io.others.bits     := position.bits
  io.isIdle          := scan.io.isIdle && !position.valid
}

/** The window of pixels that show the environment, if the frame has one. */
final class EnvironmentWindow(config: ColonnadeConfig) extends Bundle {
  val enabled = Bool()
  val rect    = new PixelRect(config.numbers.coordinateBits)

  /** A square of `size` pixels and the window have pixels in common. */
  def meets(first: PixelPosition, size: Int): Bool = enabled && EnvironmentWindow.meets(rect, first, size)
}

object EnvironmentWindow {

  /** The window in the registers. */
  def apply(config: ColonnadeConfig, registers: FrameRegisters): EnvironmentWindow = {
    val window = WireInit(0.U.asTypeOf(new EnvironmentWindow(config)))
    for (environment <- registers.environment) {
      window.enabled := environment.enabled
      window.rect    := environment.window
    }
    window
  }

  /** A square of `size` pixels and a rectangle have pixels in common. */
  def meets(rect: PixelRect, first: PixelPosition, size: Int): Bool = {
    def spans(first: UInt, low: UInt, high: UInt): Bool = low < high && first < high && first +& size.U > low
    spans(first.x, rect.x0, rect.x1) && spans(first.y, rect.y0, rect.y1)
  }
}
