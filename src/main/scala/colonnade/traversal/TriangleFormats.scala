package colonnade.traversal

import chisel3._
import colonnade.common.Context
import colonnade.config.{NumberFormats, PartConfig}
import colonnade.formats.{LeafRecord, RecordFormats}
import colonnade.numbers.{Fixed, FixedPointFormat, Normalise}
import colonnade.ray.{QueryBits, RayFormats, TriangleRay}

/** Widths between the stages of the triangle test; docs/numbers.md, section 4. A depth is a vertex's z in the ray's
  * frame. A rise is the depth of vertex 1 or 2 minus vertex 0's.
  */
final class TriangleFormats(numbers: NumberFormats) {
  val grid: FixedPointFormat = new RayFormats(numbers).grid

  /** Width of an edge function. Coordinates are within 3 · 2^(gridBits - 3) steps, so a signed edge function is two
    * bits narrower than the product of two coordinates plus its sign. The unsigned sum of three magnitudes has the same
    * width.
    */
  val edgeBits: Int = 2 * numbers.gridBits

  val weightBits: Int = numbers.weightBits

  /** Width of a rise. It is the difference of two vertices, so it is a whole number of units, or of steps if these are
    * larger. Its magnitude is at most 2^(vertexBits) units, inclusive.
    */
  val riseBits: Int = numbers.vertexBits + 2 + numbers.gridFraction.min(0)

  /** Low bits of a depth that are equal for all vertices. */
  val commonDepthBits: Int = numbers.gridFraction.max(0)

  /** |b1 · rise1 + b2 · rise2|, where b1 + b2 < 2^weightBits. */
  val numeratorBits: Int = weightBits + riseBits - 2

  val mantissaBits: Int = numbers.mantissaBits
  val digits:       Int = numbers.distanceDigits

  /** |t - depth of vertex 0| is at most the largest rise: 2^(gridBits - 3) steps, inclusive. */
  val distanceBits: Int = numbers.gridBits - 2

  /** Digits of the largest quotient, 2^(gridBits - 3) steps, that lie below one step. */
  val excessDigits: Int = (digits - (distanceBits - 1)).max(0)

  /** Zeros appended to a short quotient so that its last digit is a step. */
  val missingDigits: Int = (distanceBits - 1 - digits).max(0)

  /** Width of the right shift of a quotient: at most the numerator's leading zeros plus the excess digits. */
  val shiftBits: Int = NumberFormats.bitLength(numeratorBits + excessDigits)

  val zerosBits: Int = Normalise.exponentBits(edgeBits)
}

object TriangleFormats {

  /** `x` shifted left within its own width. */
  private[traversal] def shiftLeft(x: UInt, by: UInt): UInt = {
    val width = x.getWidth
    (by.getWidth - 1 to 0 by -1).foldLeft(x) { (value, step) =>
      val distance = 1 << step
      Mux(by(step), if (distance >= width) 0.U(width.W) else (value << distance)(width - 1, 0), value)
    }
  }
}

/** The slots of a round of the [[TriangleSequencer]]; `idle` is a slot without a round. */
object TriangleStep extends ChiselEnum {
  val idle, first, second, third, gap, last = Value
}

/** What a stage of the [[TriangleUnit]] processes in a cycle. */
final class TriangleSlot extends Bundle {
  val step   = TriangleStep()
  val isPair = Bool() // the round tests a pair of triangles; valid from `third` on
}

/** Identifies a round's triangle, or its pair of triangles. */
final class TriangleTag(config: PartConfig) extends Bundle {
  val context = Context(config)
  val id      = UInt(RecordFormats.idBits(config.device).W) // of the first triangle

  /** The round tests a pair, whose second triangle has the next id; the material transmits light. */
  val isPair         = Bool()
  val isTransmissive = Bool()
  val isNegative     = Bool() // the ray's direction, on its dominant axis
  val isMasked       = QueryBits(config)(Bool())
}

/** Depths of the vertices along the ray's dominant axis. */
final class TriangleDepths(formats: TriangleFormats) extends Bundle {
  val first = new Fixed(formats.grid)

  /** Rises of vertices 1 and 2, without the low bits that are equal for all vertices. */
  val rises = Vec(2, SInt(formats.riseBits.W))
}

/** A triangle that the ray's line crosses, with the magnitudes of its edge functions. */
final class CrossedTriangle(config: PartConfig) extends Bundle {
  private val formats = new TriangleFormats(config.numbers)

  val magnitudes = Vec(3, UInt(formats.edgeBits.W))
  val depths     = new TriangleDepths(formats)
  val id         = UInt(RecordFormats.idBits(config.device).W)
  val backSide   = Bool()
}

/** A crossed triangle with the barycentric weights of the intersection. */
final class WeightedTriangle(config: PartConfig) extends Bundle {
  private val formats = new TriangleFormats(config.numbers)

  val weights = Vec(3, UInt(formats.weightBits.W))

  /** Sum of the weights; its highest or second highest bit is set. */
  val sum      = UInt(formats.weightBits.W)
  val depths   = new TriangleDepths(formats)
  val id       = UInt(RecordFormats.idBits(config.device).W)
  val backSide = Bool()
}

/** The division for a distance: t = first ± ((dividend / divisor) >> shiftRight). */
final class DistanceRequest(config: PartConfig) extends Bundle {
  private val formats = new TriangleFormats(config.numbers)

  val dividend = UInt(formats.mantissaBits.W) // zero, or its top bit is set
  val divisor  = UInt(formats.mantissaBits.W)
  val terms    = new DistanceTerms(config)
}

/** Operands of a distance besides the quotient. */
final class DistanceTerms(config: PartConfig) extends Bundle {
  private val formats = new TriangleFormats(config.numbers)

  /** Depth of vertex 0; the quotient is subtracted from it. */
  val first      = new Fixed(formats.grid)
  val isNegative = Bool()
  val shiftRight = UInt(formats.shiftBits.W)
  val id         = UInt(RecordFormats.idBits(config.device).W)
  val weights    = Vec(3, new Fixed(new RayFormats(config.numbers).weight))
  val backSide   = Bool()
}

/** One ray to test against the triangles of one record. */
final class TriangleCandidate(config: PartConfig) extends Bundle {
  val context = Context(config)
  val address = UInt(RecordFormats.addressBits(config.device).W)
  val record  = UInt(LeafRecord.recordBits(config.device.geometry).W)
  val ray     = new TriangleRay(config.numbers)

  /** The ray's mask leaves the record's triangles out. */
  val isMasked = QueryBits(config)(Bool())
}

/** Where a ray intersects a triangle. */
sealed class HitPoint(config: PartConfig) extends Bundle {
  private val formats = new RayFormats(config.numbers)

  val t = new Fixed(formats.grid)

  /** Barycentric weights of the vertices, up to a common factor. */
  val weights  = Vec(3, new Fixed(formats.weight))
  val backSide = Bool()
}

/** The intersection of a ray with a triangle. */
final class TriangleHit(config: PartConfig) extends HitPoint(config) {
  val id = UInt(RecordFormats.idBits(config.device).W) // packed triangle id

  def point: HitPoint = {
    val point = Wire(new HitPoint(config))
    point.t        := t
    point.weights  := weights
    point.backSide := backSide
    point
  }
}

/** The result of one triangle. Results follow the order of candidates, and of triangles in a record. */
final class TriangleResult(config: PartConfig) extends Bundle {
  val context = Context(config)
  val isHit   = Bool() // the ray intersects the triangle at `hit.t` ≥ 0
  val hit     = new TriangleHit(config)

  /** The material transmits light; this is the last triangle of the record. */
  val isTransmissive = Bool()
  val isLast         = Bool()
}
