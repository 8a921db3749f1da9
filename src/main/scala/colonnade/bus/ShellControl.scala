package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.common.TimingSlice
import colonnade.config.{ColonnadeConfig, ShellConfig}

final class ShellControlIO extends Bundle {
  val commands      = Input(new ShellCommands)
  val settings      = Input(new FramebufferSettings)
  val writesAreDone = Input(Bool()) // the device has all of its registers
  val status        = Output(new ShellStatus)
  val events        = Output(UInt(Interrupts.ofFrames.size.W))

  /** Of the frame that runs, constant until its end; of the last frame that has ended. */
  val framebuffer = Output(new FramebufferSettings)
  val errors      = Output(new FramebufferError)

  /** A pulse: a frame begins or is refused, and the writer forgets the errors of the last one. */
  val clearErrors = Output(Bool())

  /** A pulse: the device starts a frame. `deviceDone` is low in the next cycle. */
  val start      = Output(Bool())
  val deviceDone = Input(Bool())
  val flush      = Output(Bool())

  /** All rows are written, and all writes answered. */
  val writerIsIdle = Input(Bool())
  val writerErrors = Input(new WriterErrors)

  val load         = Output(Bool()) // a pulse
  val loaderIsIdle = Input(Bool())
  val loadError    = Input(Bool())

  /** Resets the device, the writer and the loader, and abandons their bursts, until the bus is idle; the same a cycle
    * early.
    */
  val reset     = Output(Bool())
  val resetNext = Output(Bool())
  val busIsIdle = Input(Bool())
}

/** Runs frames and loads, one at a time, and soft resets.
  *
  * A frame ends when the device has ended it, all its rows are written and all writes are answered. A frame that is
  * started while one runs is queued, and begins when the device has its registers. A soft reset takes effect in any
  * state.
  */
final class ShellControl(config: ColonnadeConfig, shell: ShellConfig) extends Module {
  import ShellControl._

  val io = IO(new ShellControlIO)

  private object State extends ChiselEnum {
    val idle, begin, running, flushing, loading, resetting = Value
  }
  private val state    = RegInit(State.idle)
  private val isQueued = RegInit(false.B)
  private val settings = Reg(new FramebufferSettings)
  private val resets   = RegInit(0.U(log2Ceil(resetCycles + 1).W))

  // Settings are checked as they are taken
  private val takes       = WireInit(false.B)
  private val rowBytesLog = log2Ceil(config.frame.tileSize).U +& PixelFormat.bytesLog(io.settings.format)
  private val rowMask     = ((1.U << rowBytesLog) - 1.U)(log2Ceil(config.frame.tileSize * PixelFormat.maxBytes) - 1, 0)
  private val isLegal     = TimingSlice(PixelFormat.isLegal(io.settings.format), takes)
  private val photoMask   = (config.frame.tileSize * PhotoCompositor.photoBytes - 1).U
  private val photo       = io.settings.photo
  private val hasBase     = if (shell.pixelStream) !io.settings.toStream else true.B
  private val isAligned   = TimingSlice(
    (!hasBase || !((io.settings.base | io.settings.stride) & rowMask).orR) &&
      !(photo.isEnabled && ((photo.base | photo.stride) & photoMask).orR),
    takes
  )
  private val begins = state === State.begin

  private val frameDone = (state === State.flushing && io.writerIsIdle) || (begins && !io.start)
  private val hasBegun  = RegNext(state === State.loading, false.B) // the loader is also idle in the first cycle
  private val loadDone  = state === State.loading && hasBegun && io.loaderIsIdle

  when(io.commands.start) { isQueued := true.B }
  switch(state) {
    is(State.idle) {
      when((io.commands.start || isQueued) && io.writesAreDone) {
        state    := State.begin
        isQueued := false.B
        settings := io.settings
        takes    := true.B
      }.elsewhen(io.commands.load) { state := State.loading }
    }
    is(State.begin) { state := Mux(io.start, State.running, State.idle) }
    is(State.running) { when(io.deviceDone) { state := State.flushing } }
    is(State.flushing) { when(frameDone) { state := State.idle } }
    is(State.loading) { when(loadDone) { state := State.idle } }
    is(State.resetting) {
      when(resets =/= 0.U) { resets := resets - 1.U }
        .elsewhen(io.busIsIdle) { state := State.idle }
    }
  }
  when(io.commands.reset) {
    state    := State.resetting
    isQueued := false.B
    resets   := resetCycles.U
  }

  // A frame that is refused ends as it begins
  private val errors    = Wire(new FramebufferError)
  private val lastFrame = RegInit(0.U.asTypeOf(errors))
  errors.format        := begins && !isLegal
  errors.alignment     := begins && !isAligned
  errors.response      := !begins && io.writerErrors.response
  errors.window        := !begins && io.writerErrors.window
  errors.photoResponse := !begins && io.writerErrors.photoResponse
  errors.photoWindow   := !begins && io.writerErrors.photoWindow
  when(io.commands.reset) { lastFrame := 0.U.asTypeOf(errors) }.elsewhen(frameDone) { lastFrame := errors }

  io.start              := begins && isLegal && isAligned
  io.clearErrors        := begins
  io.load               := state === State.idle && io.commands.load
  io.flush              := state === State.flushing
  io.reset              := state === State.resetting
  io.resetNext          := io.commands.reset || (state === State.resetting && !(resets === 0.U && io.busIsIdle))
  io.framebuffer        := settings
  io.errors             := lastFrame
  io.status.isRunning   := begins || state === State.running || state === State.flushing
  io.status.isQueued    := isQueued
  io.status.isLoading   := state === State.loading
  io.status.isResetting := state === State.resetting

  private val hasError = Mux(loadDone, io.loadError, errors.asUInt.orR)
  io.events := ((frameDone || loadDone) && hasError) ## loadDone ## frameDone
}

object ShellControl {
  val resetCycles: Int = 8 // of the shortest soft reset

  /** What a soft reset resets. An extra slice drives it from a register; the device then runs for a cycle after
    * power-up.
    */
  def clears(config: ColonnadeConfig, reset: Bool, control: ShellControlIO): Bool = {
    val slice = TimingSlice.extra(config)
    if (slice.isEnabled) slice.flag(reset || control.resetNext, atReset = true) else reset || control.reset
  }
}

final class InterruptControllerIO(sources: Int) extends Bundle {
  private def bits = UInt(sources.W)

  val events = Input(bits) // pulses of the sources

  /** Writes of the host, 0 without one: status bits to clear, status bits to set. */
  val clear  = Input(bits)
  val test   = Input(bits)
  val enable = Input(bits)
  val status = Output(bits)

  val interrupt = Output(Bool()) // high while an enabled status bit is set
}

/** A level interrupt. A status bit stays until the host clears it; an event in the same cycle wins. */
final class InterruptController(sources: Int) extends Module {
  val io = IO(new InterruptControllerIO(sources))

  private val status = RegInit(0.U(sources.W))
  status       := (status & ~io.clear) | io.events | io.test
  io.status    := status
  io.interrupt := RegNext((status & io.enable).orR, false.B)
}
