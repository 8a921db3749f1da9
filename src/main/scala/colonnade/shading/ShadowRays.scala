package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{Light, Vec3}
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.{RayFormats, RayRequest}

/** A light that a surface wants to know about. */
final class ShadowQuestion(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val light   = UInt(log2Ceil(config.frame.lights.max(2)).W)
}

final class ShadowRaysIO(config: ColonnadeConfig) extends Bundle {
  val lights    = Input(Vec(config.frame.lights, new Light(config.numbers)))
  val unitShift = Input(UInt(NumberFormats.bitLength(config.numbers.sceneBits).W))

  /** Where a context's shadow rays start; remembered. */
  val surface  = Flipped(Valid(new LitSurface(config)))
  val question = Flipped(Decoupled(new ShadowQuestion(config)))
  val ray      = Decoupled(new RayRequest(config))
}

/** Shadow rays: from the surface that a context remembers to one light.
  *
  * One ray at a time, offered five cycles after its question: the light's position is moved up to grid steps axis by
  * axis, and the surface's taken from it a cycle later.
  */
final class ShadowRays(config: ColonnadeConfig) extends Module {
  private val numbers = config.numbers
  private val scene   = new RayFormats(numbers).scene

  val io = IO(new ShadowRaysIO(config))

  private val origins = ContextTable(config, Vec3(new Fixed(scene)))
  when(io.surface.valid) { origins.write(io.surface.bits.context, io.surface.bits.origin) }

  private val isBusy  = RegInit(false.B)
  private val step    = Reg(UInt(3.W))
  private val asked   = Reg(new ShadowQuestion(config))
  private val origin  = Reg(Vec3(new Fixed(scene)))
  private val placed  = Reg(SInt(scene.width.W))
  private val towards = Reg(Vec(3, SInt((scene.width + 1).W)))

  // The surface comes with step 0; the light's axes are placed in steps 0 to 2, and the way to it is known after step 3
  private val read = origins.read(io.question.bits.context, io.question.fire)
  when(step === 0.U) { origin := read }
  private val light    = if (config.frame.lights == 1) io.lights.head else io.lights(asked.light)
  private val position = light.position.axes.zipWithIndex.tail.foldLeft(light.position.x) {
    case (other, (axis, index)) =>
      Mux(step === index.U, axis, other)
  }
  placed := Rounding.narrow((position.pad(scene.width) << io.unitShift).asSInt, scene.width)
  for (axis <- 0 until 3) {
    when(step === (axis + 1).U) { towards(axis) := placed -& origin.axes(axis).integer }
  }

  io.question.ready := !isBusy
  when(io.question.fire) {
    isBusy := true.B
    step   := 0.U
    asked  := io.question.bits
  }.elsewhen(isBusy && step =/= 4.U) { step := step + 1.U }
  when(io.ray.fire) { isBusy := false.B }

  io.ray.valid         := isBusy && step === 4.U
  io.ray.bits.context  := asked.context
  io.ray.bits.isShadow := true.B
  io.ray.bits.origin   := origin
  io.ray.bits.dir.axes.zip(towards).foreach { case (to, from) => to := from }
}
