package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, Queue, RegEnable, Valid}
import colonnade.common.ContextTable
import colonnade.config.PathConfig
import colonnade.formats.{FrameRegisters, Pixel, PixelHit, Rgb, UnitPosition}
import colonnade.shading.PathColour

final class PixelAssemblerIO(config: PathConfig) extends Bundle {
  val background = Input(Rgb(FrameRegisters.colour))
  val allocated  = Flipped(Valid(new AllocatedPixel(config)))

  val surfaceHit = Flipped(Valid(new SurfaceHit(config)))
  val colour     = Flipped(Valid(new PathColour(config)))
  val control    = new PixelControl(config)
  val pixels     = Decoupled(new Pixel(config.device))

  /** The pixel of a context that retires is of a tile of the environment; no pixel waits here. */
  val environmentLeaves = Output(Bool())
  val isIdle            = Output(Bool())
}

/** Keeps what each context knows of its pixel, and assembles the pixel when it is done. A context retires when its
  * tables are read; the pixel follows one cycle later, into a queue that has space for it.
  */
final class PixelAssembler(config: PathConfig) extends Module {
  val io = IO(new PixelAssemblerIO(config))

  private val pixels   = ContextTable(config, new UnitPosition(config.device))
  private val colours  = ContextTable(config, new PixelColour(config))
  private val isObject = Reg(Vec(config.contexts, Bool()))
  when(io.allocated.valid) {
    pixels.write(io.allocated.bits.context, io.allocated.bits.pixel)
    isObject(io.allocated.bits.context) := false.B
  }
  private val isPrimaryHit = io.surfaceHit.valid && io.surfaceHit.bits.isPrimary
  when(isPrimaryHit) { isObject(io.surfaceHit.bits.context) := true.B }
  when(io.colour.valid) {
    val entry = Wire(new PixelColour(config))
    entry.colour                                                 := io.colour.bits.colour
    for ((to, from) <- entry.ratio.zip(io.colour.bits.ratio)) to := from
    colours.write(io.colour.bits.context, entry)
  }

  /** Finished pixels that wait. Many contexts give a pixel a cycle: two wait while one is on its way. */
  private val queueDepth = if (config.isLarge) 3 else 1

  // Retire a context
  private val done     = io.control.done
  private val finished = Wire(Decoupled(new Pixel(config.device)))
  private val queue    = Module(new Queue(new Pixel(config.device), queueDepth))
  private val retires  = done.valid && queue.io.count +& finished.valid < queueDepth.U
  io.control.retire := retires
  queue.io.enq :<>= finished
  io.pixels :<>= queue.io.deq
  io.isIdle := !finished.valid && !io.pixels.valid

  // Assemble its pixel
  private val pixel     = pixels.read(done.bits, retires)
  private val colour    = colours.read(done.bits, retires)
  private val hasColour = RegEnable(io.control.hasColour, retires)
  io.environmentLeaves   := finished.valid && !pixel.inObjectTile.getOrElse(true.B)
  finished.valid         := RegNext(retires, false.B)
  finished.bits.x        := pixel.x
  finished.bits.y        := pixel.y
  finished.bits.colour   := Mux(hasColour, colour.colour, io.background)
  finished.bits.isObject := RegEnable(isObject(done.bits), retires)
  for (ratio <- finished.bits.ratio; shadow <- colour.ratio; channel <- 0 until 3)
    ratio.channels(channel) := Mux(hasColour && !finished.bits.isObject, shadow.channels(channel), FrameRegisters.one)

  // The primary ray's hit
  for (hit <- finished.bits.hit; distance <- io.surfaceHit.bits.distance) {
    val hits = ContextTable(config, new PixelHit(config.device))
    when(isPrimaryHit) {
      val primary = Wire(new PixelHit(config.device))
      primary.triangle                                                         := io.surfaceHit.bits.id
      primary.distance.raw                                                     := distance
      for ((to, from) <- primary.instance.zip(io.surfaceHit.bits.instance)) to := from
      hits.write(io.surfaceHit.bits.context, primary)
    }
    val read = hits.read(done.bits, retires)
    hit := Mux(finished.bits.isObject, read, 0.U.asTypeOf(new PixelHit(config.device)))
  }
}

/** The colour of a pixel, and of the environment that the camera sees directly the shadow ratio. */
final private class PixelColour(config: PathConfig) extends Bundle {
  val colour = Rgb(FrameRegisters.colour)
  val ratio  = Option.when(config.device.hasEnvironment)(Rgb(FrameRegisters.weight))
}
