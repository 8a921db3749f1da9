package colonnade.query

import chisel3._
import chisel3.util.{Cat, Decoupled, RegEnable}
import colonnade.config.NumberFormats
import colonnade.formats.RayPlacement
import colonnade.numbers.{Float32, Rounding}

/** The limits of a ray, and the length of its direction along the dominant axis times the scene's scale. */
final class FloatLimits extends Bundle {
  val tNear    = new Float32
  val tFar     = new Float32
  val product  = UInt((2 * Float32.mantissaBits).W)
  val dominant = UInt(8.W) // its biased exponent
}

final class GridLimits(numbers: NumberFormats) extends Bundle {
  val tMin = UInt((numbers.sceneBits + 1).W)
  val tMax = UInt((numbers.sceneBits + 1).W)
}

final class LimitStageIO(numbers: NumberFormats) extends Bundle {
  val exponent = Input(SInt(RayPlacement.exponentBits.W))
  val in       = Flipped(Decoupled(new FloatLimits))
  val out      = Decoupled(new GridLimits(numbers))
}

/** Converts a ray's limits to grid steps: docs/numbers.md, section 9, rule 4.
  *
  * One multiplier takes the halves of two products of 72 bits, one shifter drops their fractions. Limits take
  * [[PositionStage.steps]] cycles at most; the next ones are accepted when the result is taken.
  */
final class LimitStage(numbers: NumberFormats) extends Module {
  val io = IO(new LimitStageIO(numbers))

  private val half      = Float32.mantissaBits
  private val totalBits = 3 * half
  private val limitBits = numbers.sceneBits + 1
  private val last      = 7

  // A product in steps 0 and 1, and in 2 and 3; its fraction dropped in the step after next, and rounded in the next
  private val step  = RegInit(last.U(3.W))
  private val ready = RegInit(true.B)
  private val ray   = Reg(new FloatLimits)
  private val ends  = step === last.U
  io.in.ready  := ready || io.out.fire
  io.out.valid := ends && !ready
  when(!ends) { step := step + 1.U }
  when(io.out.fire) { ready := true.B }
  when(io.in.fire) {
    ray   := io.in.bits
    step  := 0.U
    ready := false.B
  }

  private val product = held(Mux(step(1), ray.tFar, ray.tNear).mantissa *
    Mux(step(0), ray.product(2 * half - 1, half), ray.product(half - 1, 0)))
  private val low   = held(product) // of the lower halves, where the product is of the upper ones
  private val total = held(Cat(product +& (low >> half).asUInt, low(half - 1, 0))(totalBits - 1, 0))

  // In grid steps, rounded down; the exponents of numbers of two bytes fit their sums
  private val isNear = step === 3.U
  private val limit  = Mux(isNear, ray.tNear, ray.tFar)
  private val offset = (3 * half + 2 * Float32.half).S(RayConverter.exponentBits.W)
  private val amount = offset - limit.biased.zext - ray.dominant.zext -
    RayConverter.gridExponent(numbers, io.exponent)
  private val (floor, inexact) = Rounding.floorInexact(total, RayConverter.shift(amount, 127))
  private val isHuge           = !limit.isFinite || amount < 0.S || floor(totalBits - 1, limitBits).orR
  private val floored          = held(floor(limitBits - 1, 0))
  private val increment        = held(inexact || !isNear)
  private val unlimited        = ((BigInt(1) << limitBits) - 1).U
  private val saturates        = held(isHuge)
  private val rounded          = Mux(saturates || (floored.andR && increment), unlimited, floored + increment)
  private val result           = Reg(new GridLimits(numbers))
  when(step === 4.U) { result.tMin := Mux(ray.tNear.isNegative || ray.tNear.isZero, 0.U, rounded) }
  when(step === 6.U) { result.tMax := Mux(ray.tFar.isZero, 1.U, rounded) }
  io.out.bits := result

  /** Holds while a result is offered. */
  private def held[T <: Data](value: T): T = RegEnable(value, !ends)
}
