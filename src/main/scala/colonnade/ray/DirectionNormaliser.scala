package colonnade.ray

import chisel3._
import chisel3.util.{Decoupled, RegEnable, ShiftRegister, Valid}
import colonnade.common.{Context, TimingSlice}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.InstanceNumber
import colonnade.numbers.{Fixed, Normalise, Normalised, Rounding}

/** Mantissas of a direction in the ray's own frame, from which the quotients are computed. */
final class DirectionMantissas(numbers: NumberFormats) extends Bundle {

  /** 0 for a component that is 0; otherwise the top bit is set. */
  val minor    = Vec(2, UInt(numbers.mantissaBits.W))
  val dominant = UInt(numbers.mantissaBits.W)
}

/** Properties of a ray's direction besides its mantissas. */
final class DirectionInfo(config: PathConfig) extends Bundle {
  val context     = Context(config)
  val isShadow    = Bool()
  val orientation = new RayOrientation

  /** Bits by which x' and y' are shorter than the dominant component; components that are 0. */
  val exponent = Vec(2, UInt(Normalise.exponentBits(config.numbers.directionBits).W))
  val isZero   = Vec(3, Bool())

  val visit = InstanceNumber(config.device).map(Valid(_))

  /** Takes over the instance of a visit. */
  def ofVisit(from: Valid[VisitLimit]): Unit = for (to <- visit) {
    to.valid := from.valid
    to.bits  := from.bits.instance
  }

  /** Whether x' and y' are so short that the largest reciprocal stands for theirs. */
  def isTiny: Seq[Bool] = isZero.take(2).zip(exponent).map { case (zero, by) =>
    zero || by > config.numbers.reciprocalFraction.U
  }
}

/** A ray in its own frame while its quotients are being computed. */
final class PermutedRay(config: PathConfig) extends Bundle {
  private val numbers = config.numbers

  val info   = new DirectionInfo(config)
  val origin = Vec(3, new Fixed(new RayFormats(numbers).scene))

  /** Largest t in grid steps; it saturates above the sum of an entry distance and the largest t of the grid. */
  val tMax = UInt((numbers.sceneBits + 1).W)

  val limits = QueryBits(config)(new RayLimits(numbers))
}

final class DirectionNormaliserIO(config: PathConfig) extends Bundle {
  val request   = Flipped(Decoupled(new RayRequest(config)))
  val mantissas = Decoupled(new DirectionMantissas(config.numbers))
  val ray       = Decoupled(new PermutedRay(config))
}

/** Finds a ray's dominant axis, permutes the ray to its own frame and normalises its direction.
  *
  * The components share one normaliser, then the axes rotate one step per cycle. Latency from the request to both
  * results: 4 cycles for dominant axis z, 5 for x, 6 for y, with `units.extraSlices` one more. The results are
  * independent of each other; the next request is accepted in the cycle that takes the last of them. Source:
  * docs/numbers.md, sections 2.1 and 2.2.
  */
final class DirectionNormaliser(config: PathConfig) extends Module {
  private val numbers = config.numbers

  // The steps. With extra slices the leading zeros of a magnitude are counted in a cycle of their own
  private val delay   = TimingSlice.extra(config.device).cycles
  private val idle    = 0.U(3.W)
  private val first   = (1 + delay).U(3.W)
  private val last    = (3 + delay).U(3.W)
  private val settled = (4 + delay).U(3.W)

  val io = IO(new DirectionNormaliserIO(config))

  // Control: the magnitude of a component and the mantissa of the previous one, then rotations
  private val step         = RegInit(idle)
  private val rotations    = Reg(UInt(2.W))
  private val hasMantissas = RegInit(false.B)
  private val hasRay       = RegInit(false.B)

  private val measures   = io.request.fire || (step =/= idle && step < 3.U)
  private val normalises = (if (delay == 0) step =/= idle else step >= first) && step <= last
  private val isLeft     = (!hasMantissas || io.mantissas.ready) && (!hasRay || io.ray.ready)
  private val isSettled  = step === settled && rotations === 0.U
  private val rotates    = step === settled && rotations =/= 0.U

  io.mantissas.valid := isSettled && hasMantissas
  io.ray.valid       := isSettled && hasRay
  io.request.ready   := step === idle || (isSettled && isLeft)
  when(step =/= idle && step =/= settled) { step := step + 1.U }
  when(io.mantissas.fire) { hasMantissas := false.B }
  when(io.ray.fire) { hasRay := false.B }
  when(isSettled && isLeft) { step := idle }
  when(io.request.fire) {
    step         := 1.U
    hasMantissas := true.B
    hasRay       := true.B
  }

  // Datapath: the magnitude of x is computed on arrival, y and z wait; normalised components shift into `directions`
  private val context    = RegEnable(io.request.bits.context, io.request.fire)
  private val isShadow   = RegEnable(io.request.bits.isShadow, io.request.fire)
  private val axis       = Reg(UInt(2.W))
  private val origin     = Reg(Vec(3, new Fixed(new RayFormats(numbers).scene)))
  private val dir        = Reg(Vec(2, SInt(numbers.directionBits.W)))
  private val directions =
    Reg(Vec(3, new Normalised(numbers.mantissaBits, Normalise.exponentBits(numbers.directionBits))))
  private val negative = Reg(Vec(3, Bool()))
  private val largest  = Reg(UInt(numbers.directionBits.W))

  private val isBetween       = step === idle || step === settled
  private val measured        = Mux(isBetween, io.request.bits.dir.x, dir.head)
  private val counted         = RegEnable(Normalise.magnitude(measured), measures)
  private val hasSign         = RegEnable(measured < 0.S, measures)
  private val magnitude       = ShiftRegister(counted, delay)
  private val isNegative      = ShiftRegister(hasSign, delay)
  private val (isNull, zeros) = {
    val (isNull, zeros) = Normalise.countLeadingZeros(counted)
    (ShiftRegister(isNull, delay), ShiftRegister(zeros, delay))
  }
  private val isDominant = step === first || magnitude > largest

  when(io.request.fire) {
    origin.zip(io.request.bits.origin.axes).foreach { case (to, from) => to := from }
    dir.zip(io.request.bits.dir.axes.tail).foreach { case (to, from) => to := from }
  }.elsewhen(measures) { dir.head := dir.last }
  when(normalises || rotates) {
    shift(directions, Mux(rotates, directions.head, Normalise(magnitude, isNull, zeros, numbers.mantissaBits)))
    shift(negative, Mux(rotates, negative.head, isNegative))
  }
  when(normalises && isDominant) {
    largest   := magnitude
    axis      := step - first
    rotations := Mux(step === last, 0.U, step - delay.U)
  }
  when(rotates) {
    shift(origin, origin.head)
    rotations := rotations - 1.U
  }

  private val dominant = directions.last
  io.mantissas.bits.minor.zip(directions).foreach { case (to, from) => to := from.mantissa }
  io.mantissas.bits.dominant := dominant.mantissa

  private val info = io.ray.bits.info
  info.context              := context
  info.isShadow             := isShadow
  info.orientation.axis     := axis
  info.orientation.negative := negative
  info.exponent.zip(directions).foreach { case (to, from) => to := dominant.exponent - from.exponent }
  info.isZero.zip(directions).foreach { case (to, from) => to := from.exponent === 0.U }

  io.ray.bits.origin := origin
  private val unlimited = ((BigInt(1) << (numbers.sceneBits + 1)) - 1).U
  io.ray.bits.tMax := Mux(isShadow, Rounding.saturate(largest, numbers.sceneBits + 1), unlimited)
  for (visit <- io.request.bits.visit) {
    val held = RegEnable(visit, io.request.fire)
    info.ofVisit(held)
    when(held.valid) { io.ray.bits.tMax := held.bits.tMax }
  }

  private def shift[T <: Data](queue: Vec[T], last: T): Unit = {
    queue.zip(queue.tail).foreach { case (to, from) => to := from }
    queue.last := last
  }
}
