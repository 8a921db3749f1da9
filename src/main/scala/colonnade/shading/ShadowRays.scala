package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{Light, Vec3}
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.{RayFormats, RayRequest}

/** A context and a light to trace a shadow ray to. */
final class ShadowRequest(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val light   = UInt(log2Ceil(config.frame.lights.max(2)).W)
}

/** Ports of [[ShadowRays]]. */
final class ShadowRaysIO(config: ColonnadeConfig) extends Bundle {
  val lights    = Input(Vec(config.frame.lights, new Light(config.numbers)))
  val unitShift = Input(UInt(NumberFormats.bitLength(config.numbers.sceneBits).W))

  /** The surface at which a context's shadow rays start; remembered. */
  val surface = Flipped(Valid(new LitSurface(config)))
  val req     = Flipped(Decoupled(new ShadowRequest(config)))
  val ray     = Decoupled(new RayRequest(config))
}

/** Makes shadow rays, from a context's surface to a light.
  *
  * One ray at a time, offered five cycles after its request. The light's position is shifted to grid steps axis by axis,
  * and the surface's position is subtracted one cycle later.
  */
final class ShadowRays(config: ColonnadeConfig) extends Module {
  private val numbers = config.numbers
  private val scene   = new RayFormats(numbers).scene

  val io = IO(new ShadowRaysIO(config))

  private val origins = ContextTable(config, Vec3(new Fixed(scene)))
  when(io.surface.valid) { origins.write(io.surface.bits.context, io.surface.bits.origin) }

  private val isBusy  = RegInit(false.B)
  private val step    = Reg(UInt(3.W))
  private val request = Reg(new ShadowRequest(config))
  private val origin  = Reg(Vec3(new Fixed(scene)))
  private val shifted = Reg(SInt(scene.width.W))
  private val dir     = Reg(Vec(3, SInt((scene.width + 1).W)))

  // The surface is read in step 0. The light's axes are shifted in steps 0 to 2; the direction is complete after step 3
  private val read = origins.read(io.req.bits.context, io.req.fire)
  when(step === 0.U) { origin := read }
  private val light    = if (config.frame.lights == 1) io.lights.head else io.lights(request.light)
  private val position = light.position.axes.zipWithIndex.tail.foldLeft(light.position.x) {
    case (other, (axis, index)) =>
      Mux(step === index.U, axis, other)
  }
  shifted := Rounding.narrow((position.pad(scene.width) << io.unitShift).asSInt, scene.width)
  for (axis <- 0 until 3) {
    when(step === (axis + 1).U) { dir(axis) := shifted -& origin.axes(axis).integer }
  }

  io.req.ready := !isBusy
  when(io.req.fire) {
    isBusy  := true.B
    step    := 0.U
    request := io.req.bits
  }.elsewhen(isBusy && step =/= 4.U) { step := step + 1.U }
  when(io.ray.fire) { isBusy := false.B }

  io.ray.valid         := isBusy && step === 4.U
  io.ray.bits.context  := request.context
  io.ray.bits.isShadow := true.B
  io.ray.bits.origin   := origin
  io.ray.bits.dir.axes.zip(dir).foreach { case (to, from) => to := from }
}

object ShadowRays {

  /** The ports of a new unit: with `units.pipelined` a [[ShadowRaysPipeline]]. */
  def apply(config: ColonnadeConfig): ShadowRaysIO =
    if (config.units.pipelined) Module(new ShadowRaysPipeline(config)).io else Module(new ShadowRays(config)).io
}
