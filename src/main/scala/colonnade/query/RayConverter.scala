package colonnade.query

import chisel3._
import chisel3.util.{Decoupled, RegEnable}
import colonnade.common.Context
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{RayPlacement, RayRecord}
import colonnade.numbers.Float32
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

/** Converts an application's rays to grid steps: docs/numbers.md, section 9. In order, a ray every [[PositionStage.steps]]
  * cycles: [[PositionStage]] converts the positions, then [[LimitStage]] the limits.
  */
final class RayConverter(config: PathConfig) extends Module {
  val io = IO(new RayConverterIO(config))

  private val positions = Module(new PositionStage(config)).io
  private val limits    = Module(new LimitStage(config.numbers)).io
  positions.placement := io.placement
  limits.exponent     := io.placement.exponent
  positions.rays :<>= io.rays

  // The limits of a ray, and the rest of it
  private val placed = positions.placed
  private val ray    = RegEnable(placed.bits.converted, placed.fire)
  placed.ready       := limits.in.ready
  limits.in.valid    := placed.valid
  limits.in.bits     := placed.bits.limits
  io.converted.valid := limits.out.valid
  limits.out.ready   := io.converted.ready
  io.converted.bits  := ray
  for (limit <- io.converted.bits.request.limits) {
    limit.tMin := limits.out.bits.tMin
    limit.tMax := limits.out.bits.tMax
  }
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
