package colonnade.ray

import chisel3._
import chisel3.util.{Decoupled, RegEnable}
import colonnade.common.Context
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.numbers.{Fixed, Normalise, Normalised, Rounding}

/** Mantissas of a direction in the ray's own frame: what the quotients are made of. */
final class DirectionMantissas(numbers: NumberFormats) extends Bundle {

  /** 0 for a component that is 0; otherwise the top bit is set. */
  val minor = Vec(2, UInt(numbers.mantissaBits.W))

  /** As [[minor]]. */
  val dominant = UInt(numbers.mantissaBits.W)
}

/** What set-up knows of a ray's direction besides its mantissas. */
final class RayCourse(config: ColonnadeConfig) extends Bundle {
  val context  = Context(config)
  val isShadow = Bool()
  val heading  = new Heading

  /** By how many bits x' and y' are shorter than the dominant component. */
  val exponent = Vec(2, UInt(Normalise.exponentBits(config.numbers.directionBits).W))

  /** Components of the direction that are 0. */
  val isZero = Vec(3, Bool())
}

/** A ray in its own frame while its quotients are being computed. */
final class PermutedRay(config: ColonnadeConfig) extends Bundle {
  private val numbers = config.numbers

  val course = new RayCourse(config)
  val origin = Vec(3, new Fixed(new RayFormats(numbers).scene))

  /** Largest t in grid steps; saturated beyond what an entry distance and the largest t of the grid add up to. */
  val limit = UInt((numbers.sceneBits + 1).W)
}

final class DirectionNormaliserIO(config: ColonnadeConfig) extends Bundle {
  val request   = Flipped(Decoupled(new RayRequest(config)))
  val mantissas = Decoupled(new DirectionMantissas(config.numbers))
  val ray       = Decoupled(new PermutedRay(config))
}

/** Finds a ray's dominant axis, turns the ray into its own frame and normalises its direction.
  *
  * The components pass one normaliser in turn, then the ray is rotated axis by axis: 4 cycles from the request to both
  * results for dominant axis z, 5 for x, 6 for y. The results leave independently of each other; the next request is
  * accepted in the cycle in which the last of them does. Source: docs/numbers.md, sections 2.1 and 2.2.
  */
final class DirectionNormaliser(config: ColonnadeConfig) extends Module {
  import DirectionNormaliser._
  private val numbers = config.numbers

  val io = IO(new DirectionNormaliserIO(config))

  // Control: the magnitude of one component, the mantissa of the one before, then the turns
  private val step         = RegInit(idle)
  private val turns        = Reg(UInt(2.W))
  private val hasMantissas = RegInit(false.B)
  private val hasRay       = RegInit(false.B)

  private val measures   = io.request.fire || (step =/= idle && step < last)
  private val normalises = step =/= idle && step <= last
  private val isLeft     = (!hasMantissas || io.mantissas.ready) && (!hasRay || io.ray.ready)
  private val isSettled  = step === settled && turns === 0.U
  private val rotates    = step === settled && turns =/= 0.U

  io.mantissas.valid := isSettled && hasMantissas
  io.ray.valid       := isSettled && hasRay
  io.request.ready   := step === idle || (isSettled && isLeft)
  when(step =/= idle && step =/= settled) { step := step + 1.U }
  when(io.mantissas.fire) { hasMantissas := false.B }
  when(io.ray.fire) { hasRay := false.B }
  when(isSettled && isLeft) { step := idle }
  when(io.request.fire) {
    step         := first
    hasMantissas := true.B
    hasRay       := true.B
  }

  // Datapath: x is measured as it comes, y and z wait; what is normalised enters `directions` at its end
  private val context    = RegEnable(io.request.bits.context, io.request.fire)
  private val isShadow   = RegEnable(io.request.bits.isShadow, io.request.fire)
  private val axis       = Reg(UInt(2.W))
  private val origin     = Reg(Vec(3, new Fixed(new RayFormats(numbers).scene)))
  private val towards    = Reg(Vec(2, SInt(numbers.directionBits.W)))
  private val directions =
    Reg(Vec(3, new Normalised(numbers.mantissaBits, Normalise.exponentBits(numbers.directionBits))))
  private val negative = Reg(Vec(3, Bool()))
  private val largest  = Reg(UInt(numbers.directionBits.W))

  // The most negative component's magnitude has as many bits as the component.
  private val isBetween  = step === idle || step === settled
  private val measured   = Mux(isBetween, io.request.bits.towards.x, towards.head)
  private val magnitude  = RegEnable(magnitudeOf(measured), measures)
  private val isNegative = RegEnable(measured < 0.S, measures)
  private val isDominant = step === first || magnitude > largest

  when(io.request.fire) {
    origin.zip(io.request.bits.origin.axes).foreach { case (to, from) => to := from }
    towards.zip(io.request.bits.towards.axes.tail).foreach { case (to, from) => to := from }
  }.elsewhen(measures) { towards.head := towards.last }
  when(normalises || rotates) {
    shift(directions, Mux(rotates, directions.head, Normalise(magnitude, numbers.mantissaBits)))
    shift(negative, Mux(rotates, negative.head, isNegative))
  }
  when(normalises && isDominant) {
    largest := magnitude
    axis    := step - first
    turns   := Mux(step === last, 0.U, step)
  }
  when(rotates) {
    shift(origin, origin.head)
    turns := turns - 1.U
  }

  private val dominant = directions.last
  io.mantissas.bits.minor.zip(directions).foreach { case (to, from) => to := from.mantissa }
  io.mantissas.bits.dominant := dominant.mantissa

  private val course = io.ray.bits.course
  course.context          := context
  course.isShadow         := isShadow
  course.heading.axis     := axis
  course.heading.negative := negative
  course.exponent.zip(directions).foreach { case (to, from) => to := dominant.exponent - from.exponent }
  course.isZero.zip(directions).foreach { case (to, from) => to := from.exponent === 0.U }

  io.ray.bits.origin := origin
  private val unlimited = ((BigInt(1) << (numbers.sceneBits + 1)) - 1).U
  io.ray.bits.limit := Mux(isShadow, Rounding.saturate(largest, numbers.sceneBits + 1), unlimited)

  private def magnitudeOf(component: SInt): UInt = Mux(component < 0.S, 0.S -% component, component).asUInt

  private def shift[T <: Data](queue: Vec[T], last: T): Unit = {
    queue.zip(queue.tail).foreach { case (to, from) => to := from }
    queue.last := last
  }
}

/** The steps of a [[DirectionNormaliser]]. */
private object DirectionNormaliser {
  val idle    = 0.U(3.W)
  val first   = 1.U(3.W)
  val last    = 3.U(3.W)
  val settled = 4.U(3.W)
}
