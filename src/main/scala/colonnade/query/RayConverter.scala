package colonnade.query

import chisel3._
import chisel3.util.Decoupled
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
