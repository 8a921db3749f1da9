package colonnade.frame

import chisel3._
import chisel3.util.{is, log2Ceil, switch}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameSettings, Status}

/** The progress of a column. */
final class ColumnProgress extends Bundle {

  /** Every pixel of the accepted tiles has retired, including the one that retires in this cycle. */
  val isDrained = Bool()
  val isIdle    = Bool()
}

/** The state of the pixel streams in a cycle: a pixel leaves the device; a pixel waits for the sink. */
final class PixelTraffic extends Bundle {
  val retires = Bool()
  val stalls  = Bool()
}

final class FrameControllerIO(config: ColonnadeConfig) extends Bundle {
  private val columns = config.array.columns

  /** Starts a frame; ignored while one runs. */
  val start  = Input(Bool())
  val frame  = Input(new FrameSettings(config.numbers))
  val window = Input(new EnvironmentWindow(config))

  /** By column. Valid only where ready is set, see `Dispatcher`. */
  val tiles    = Vec(columns, new ColumnTiles(config))
  val progress = Input(Vec(columns, new ColumnProgress))
  val traffic  = Input(new PixelTraffic)

  /** No read of the scene is in flight outside the columns. */
  val memoryIsIdle = Input(Bool())

  val frameStart = Output(Bool()) // a frame starts: resets the state of the previous one

  /** From the cycle after the start to the cycle of the last pixel. */
  val isRunning = Output(Bool())

  val aborts = Output(Bool()) // resets the columns

  /** A frame ends without the answers to its reads, see [[memoryIsIdle]]. */
  val memoryTimeout = Output(Bool())

  val status        = Output(new Status)
  val watchdogError = Output(Bool()) // sticky until the next start
}

/** Runs frames: dispatches tiles of all kinds in parallel, waits for the last pixel, and ends the
  * frame when the device is idle.
  *
  * The first tile comes four cycles after the start. `done` follows the last pixel by [[FrameController.settleCycles]]
  * or more, so that counters and errors are complete. A frame without pixels ends at once. The watchdog aborts a frame
  * in which no pixel leaves for `watchdogCycles`, not counting stalls of the sink; the frame then ends with an error.
  *
  * After an abort the frame waits for reads in flight, for `watchdogCycles` at most: a memory that never answers does
  * not hang the device. The next frame waits for these reads under the same limit.
  */
final class FrameController(config: ColonnadeConfig) extends Module {
  import FrameController._

  val io = IO(new FrameControllerIO(config))

  private val state    = RegInit(State.waiting)
  private val settling = Reg(UInt(log2Ceil(settleCycles + 1).W))
  private val done     = RegInit(false.B)
  private val error    = RegInit(false.B)

  private val schedulers = withReset(reset.asBool || io.aborts) {
    TileKind.all(config).map(kind => kind -> Module(new TileScheduler(config, kind)))
  }
  private val watchdog = Module(new Watchdog(io.frame.watchdogCycles.getWidth))

  private val isFinished = schedulers.map(_._2.io.isIdle).reduce(_ && _) && io.progress.map(_.isDrained).reduce(_ && _)
  private val isSettled  = settling === 0.U && io.progress.map(_.isIdle).reduce(_ && _)

  switch(state) {
    is(State.waiting) {
      when(io.start) {
        state := Mux(io.memoryIsIdle, State.running, State.draining)
        done  := false.B
        error := false.B
      }
    }
    is(State.draining) { when(io.memoryIsIdle) { state := State.running } }
    is(State.running) {
      settling := settleCycles.U
      when(isFinished) { state := State.settling }.elsewhen(watchdog.io.isExpired) { state := State.aborting }
    }
    is(State.aborting) {
      state := State.settling
      error := true.B
    }
    is(State.settling) {
      when(settling =/= 0.U) { settling := settling - 1.U }
      when(isSettled && io.memoryIsIdle) {
        state := State.waiting
        done  := true.B
      }.elsewhen(watchdog.io.isExpired) { state := State.aborting }
    }
  }
  when(io.memoryTimeout) {
    state := State.waiting
    done  := true.B
    error := true.B
  }

  private val starts = state === State.waiting && io.start
  io.frameStart    := (starts || state === State.draining) && io.memoryIsIdle
  io.memoryTimeout := watchdog.io.isExpired && !io.memoryIsIdle &&
    (state === State.draining || (state === State.settling && error && isSettled))
  io.isRunning := state === State.running
  io.aborts    := state === State.aborting

  watchdog.io.limit   := io.frame.watchdogCycles
  watchdog.io.restart := starts || io.frameStart || io.aborts || io.traffic.retires
  watchdog.io.hold    := io.traffic.stalls || state === State.waiting

  for ((kind, scheduler) <- schedulers) {
    scheduler.io.frame  := io.frame
    scheduler.io.window := io.window
    scheduler.io.start  := io.frameStart
    io.tiles.zip(scheduler.io.tiles).foreach { case (column, tiles) => column(kind) :<>= tiles }
  }

  io.status.busy   := state =/= State.waiting
  io.status.done   := done
  io.watchdogError := error
}

object FrameController {

  /** Cycles until the counters are complete after the last pixel. */
  val settleCycles: Int = CounterFile.settleCycles

  private object State extends ChiselEnum {
    val waiting, draining, running, aborting, settling = Value
  }
}

final class WatchdogIO(bits: Int) extends Bundle {

  /** Cycles without progress until it expires; 0 disables it. */
  val limit = Input(UInt(bits.W))

  val restart = Input(Bool()) // resets the count
  val hold    = Input(Bool()) // do not count this cycle

  val isExpired = Output(Bool())
}

/** Counts the cycles since the last progress; expires in the cycle after `limit` of them. */
final class Watchdog(bits: Int) extends Module {
  val io = IO(new WatchdogIO(bits))

  private val count = RegInit(0.U(bits.W))
  io.isExpired := io.limit =/= 0.U && count === io.limit

  when(io.restart) {
    count := 0.U
  }.elsewhen(!io.hold && !io.isExpired) {
    count := count + 1.U
  }
}
