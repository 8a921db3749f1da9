package colonnade.query

import chisel3._
import chisel3.util.{Cat, Decoupled, RegEnable}
import colonnade.common.Context
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{RayPlacement, RayRecord}
import colonnade.numbers.{Float32, Rounding}
import colonnade.ray.{HitFilter, RayRequest}

/** A ray of a batch. */
final class BatchRay(config: PathConfig) extends Bundle {
  val context    = Context(config)
  val isOccluded = Bool() // the first hit ends the ray
  val isLocal    = Bool() // its origin is relative to the position (0, 0, 0)
  val filter     = new HitFilter
  val record     = new RayRecord
}

/** What the hit of a ray needs of it: the length of its direction along the dominant axis, and the t of a miss. */
final class RayScale extends Bundle {
  val dominant     = new Float32
  val tFar         = new Float32
  val isOutOfRange = Bool()
}

/** A ray in the device's integers. A ray that is refused, or out of range, has the direction 0: it misses. */
final class ConvertedRay(config: PathConfig) extends Bundle {
  val request   = new RayRequest(config)
  val scale     = new RayScale
  val isRefused = Bool()
}

final class RayConverterIO(config: PathConfig) extends Bundle {
  val placement = Input(new RayPlacement) // constant while a ray is in the unit
  val rays      = Flipped(Decoupled(new BatchRay(config)))
  val converted = Decoupled(new ConvertedRay(config))
}

/** Converts an application's rays to grid steps: docs/numbers.md, section 9. In order, a ray every
  * [[PositionStage.interval]] cycles: [[PositionStage]] converts the positions, then [[LimitStage]] the limits.
  */
final class RayConverter(config: PathConfig) extends Module {
  val io = IO(new RayConverterIO(config))

  private val positions = Module(new PositionStage(config)).io
  private val limits    = Module(new LimitStage(config)).io
  positions.placement := io.placement
  limits.exponent     := io.placement.exponent
  positions.rays :<>= io.rays
  limits.in :<>= positions.placed
  io.converted :<>= limits.out
}

object RayConverter {

  /** Bits of the exponents' sums. */
  val exponentBits: Int = 12

  /** The exponent of a placement and the grid, as a number of the sums. */
  def gridExponent(numbers: NumberFormats, exponent: SInt): SInt = exponent +& numbers.gridFraction.S(8.W)

  /** An amount, not below 0, saturated to `limit`. */
  def shift(amount: SInt, limit: Int): UInt =
    Mux(amount >= limit.S, limit.U, amount.asUInt)(NumberFormats.bitLength(limit) - 1, 0)
}

/** The limits of a ray, and the length of its direction along the dominant axis times the scene's scale. */
final class FloatLimits extends Bundle {
  val tNear    = new Float32
  val tFar     = new Float32
  val product  = UInt((2 * Float32.mantissaBits).W)
  val dominant = UInt(8.W) // its biased exponent
}

final class LimitStageIO(config: PathConfig) extends Bundle {
  val exponent = Input(SInt(RayPlacement.exponentBits.W)) // constant while a ray is in the unit
  val in       = Flipped(Decoupled(new PlacedRay(config)))
  val out      = Decoupled(new ConvertedRay(config))
}

/** Converts a ray's limits to grid steps: docs/numbers.md, section 9, rule 4.
  *
  * One multiplier takes the halves of two products of 72 bits, one shifter drops their fractions. Throughput: a ray
  * every [[PositionStage.interval]] cycles; latency: 8 cycles. All steps stand still while a result is not taken.
  */
final class LimitStage(config: PathConfig) extends Module {
  val io = IO(new LimitStageIO(config))

  private val numbers   = config.numbers
  private val half      = Float32.mantissaBits
  private val totalBits = 3 * half
  private val limitBits = numbers.sceneBits + 1

  // A product in steps 0 and 1, and in 2 and 3; its fraction dropped in the step after next, and rounded in the next
  private val arrives = io.in.fire
  private val step    = RegInit(VecInit.fill(8)(false.B))
  private val moves   = !step.last || io.out.ready
  private val placed  = RegEnable(io.in.bits, arrives)
  private val ray     = placed.limits
  io.in.ready  := moves && !step.take(PositionStage.interval - 1).reduce(_ || _)
  io.out.valid := step.last
  when(moves) { step.zip(arrives +: step).foreach { case (to, from) => to := from } }

  private val product = held(Mux(step(2) || step(3), ray.tFar, ray.tNear).mantissa *
    Mux(step(1) || step(3), ray.product(2 * half - 1, half), ray.product(half - 1, 0)))
  private val low   = held(product) // of the lower halves, where the product is of the upper ones
  private val total = held(Cat(product +& (low >> half).asUInt, low(half - 1, 0))(totalBits - 1, 0))

  // In grid steps, rounded down; the exponents of numbers of two bytes fit their sums
  private val isNear = step(3)
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
  private val tMin             = Reg(UInt(limitBits.W))
  private val tMax             = Reg(UInt(limitBits.W))
  private val last             = RegEnable(placed, moves && step(5)) // before the next ray comes
  when(step(4)) { tMin := Mux(ray.tNear.isNegative || ray.tNear.isZero, 0.U, rounded) }
  when(step(6)) { tMax := Mux(last.limits.tFar.isZero, 1.U, rounded) }
  io.out.bits := last.converted
  for (limit <- io.out.bits.request.limits) {
    limit.tMin := tMin
    limit.tMax := tMax
  }

  private def held[T <: Data](value: T): T = RegEnable(value, moves)
}
