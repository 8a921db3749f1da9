package colonnade.frame

import chisel3._
import chisel3.util.{is, log2Ceil, switch, Decoupled}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameSettings, Status}

/** How far a column is. */
final class ColumnProgress extends Bundle {

  /** Every pixel of the tiles taken has left, the one that leaves in this cycle included. */
  val isDrained = Bool()

  /** Nothing moves any more. */
  val isIdle = Bool()
}

/** What the streams of pixels do in a cycle. */
final class PixelTraffic extends Bundle {

  /** A pixel leaves the device. */
  val leaves = Bool()

  /** A pixel waits for the sink. */
  val stalls = Bool()
}

/** Ports of [[FrameController]]. */
final class FrameControllerIO(config: ColonnadeConfig) extends Bundle {
  private val columns = config.array.columns

  /** Begins a frame; ignored while one runs. */
  val start = Input(Bool())
  val frame = Input(new FrameSettings(config.numbers))

  /** Render units get its pixels too. */
  val window = Input(new RoomWindow(config))

  /** Valid only where ready is set, see [[Dispatcher]]. */
  val tiles = Vec(columns, Decoupled(new Tile(config)))

  /** Tiles without a pixel that may see the object. */
  val backgroundTiles = Vec(columns, Decoupled(new Tile(config)))
  val progress        = Input(Vec(columns, new ColumnProgress))
  val traffic         = Input(new PixelTraffic)

  /** A frame begins: clears what is left of the last one. */
  val begins = Output(Bool())

  /** From the cycle after the start to that of the last pixel. */
  val isRunning = Output(Bool())

  /** The columns forget all that is in flight. */
  val aborts = Output(Bool())

  val status = Output(new Status)

  /** Sticky until the next start. */
  val watchdogError = Output(Bool())
}

/** Runs frames: hands out the tiles, those of the object and those of the background side by side, sees the last pixel leave, and ends the frame when the device has come to rest.
  *
  * The first tile is out four cycles after the start; `done` follows the last pixel by [[FrameController.settleCycles]]
  * or more, so that counters and errors are complete. A frame without pixels ends at once. A frame from which no pixel
  * leaves for `watchdogCycles` (stalls of the sink not counted, 0 is for ever) is aborted: it ends with an error.
  */
final class FrameController(config: ColonnadeConfig) extends Module {
  import FrameController._

  val io = IO(new FrameControllerIO(config))

  private val state    = RegInit(State.waiting)
  private val settling = Reg(UInt(log2Ceil(settleCycles + 1).W))
  private val done     = RegInit(false.B)
  private val error    = RegInit(false.B)

  private val dealers = withReset(reset.asBool || io.aborts) {
    Seq(true, false).map(ofObject => Module(new TileDealer(config, ofObject)))
  }
  private val watchdog = Module(new Watchdog(io.frame.watchdogCycles.getWidth))

  private val isFinished = dealers.map(_.io.isIdle).reduce(_ && _) && io.progress.map(_.isDrained).reduce(_ && _)
  private val isAtRest   = settling === 0.U && io.progress.map(_.isIdle).reduce(_ && _)

  switch(state) {
    is(State.waiting) {
      when(io.start) {
        state := State.running
        done  := false.B
        error := false.B
      }
    }
    is(State.running) {
      settling := settleCycles.U
      when(isFinished) {
        state := State.settling
      }.elsewhen(watchdog.io.isExpired) {
        state := State.aborting
      }
    }
    is(State.aborting) {
      state := State.settling
      error := true.B
    }
    is(State.settling) {
      when(settling =/= 0.U) { settling := settling - 1.U }
      when(isAtRest) {
        state := State.waiting
        done  := true.B
      }.elsewhen(watchdog.io.isExpired) {
        state := State.aborting
      }
    }
  }

  io.begins    := state === State.waiting && io.start
  io.isRunning := state === State.running
  io.aborts    := state === State.aborting

  watchdog.io.limit   := io.frame.watchdogCycles
  watchdog.io.restart := io.begins || io.aborts || io.traffic.leaves
  watchdog.io.hold    := io.traffic.stalls || state === State.waiting

  dealers.zip(Seq(io.tiles, io.backgroundTiles)).foreach { case (dealer, tiles) =>
    dealer.io.frame  := io.frame
    dealer.io.window := io.window
    dealer.io.start  := io.begins
    tiles <> dealer.io.tiles
  }

  io.status.busy   := state =/= State.waiting
  io.status.done   := done
  io.watchdogError := error
}

object FrameController {

  /** Cycles that the counters need after the last pixel. */
  val settleCycles: Int = CounterFile.settleCycles

  private object State extends ChiselEnum {
    val waiting, running, aborting, settling = Value
  }
}
