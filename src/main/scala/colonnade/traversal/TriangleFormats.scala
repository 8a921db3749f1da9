package colonnade.traversal

import chisel3._
import colonnade.common.Context
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.RecordFormats
import colonnade.numbers.{Fixed, FixedPointFormat, Normalise}
import colonnade.ray.RayFormats

/** Widths between the steps of the triangle test; docs/numbers.md, section 4. A depth is a vertex's z in the ray's
  * frame, a rise is a depth less that of vertex 0.
  */
final class TriangleFormats(numbers: NumberFormats) {
  val grid: FixedPointFormat = new RayFormats(numbers).grid

  /** An edge function: coordinates are within 3 · 2^(gridBits - 3) steps, so it needs its sign and two bits less than
    * the product of two coordinates. The sum of three magnitudes takes the same bits without a sign.
    */
  val edgeBits: Int = 2 * numbers.gridBits

  val weightBits: Int = numbers.weightBits

  /** A rise is a difference of two vertices, so it is whole in units, or in steps where these are larger: up to
    * 2^(vertexBits) units, in either direction and inclusive.
    */
  val riseBits: Int = numbers.vertexBits + 2 + numbers.gridFraction.min(0)

  /** Low bits of a depth that two vertices have in common. */
  val commonDepthBits: Int = numbers.gridFraction.max(0)

  /** |b1 · rise1 + b2 · rise2|, where b1 + b2 < 2^weightBits. */
  val numeratorBits: Int = weightBits + riseBits - 2

  val mantissaBits: Int = numbers.mantissaBits
  val digits:       Int = numbers.distanceDigits

  /** |t - depth of vertex 0| is at most the largest rise: 2^(gridBits - 3) steps, inclusive. */
  val distanceBits: Int = numbers.gridBits - 2

  /** The largest quotient is 2^(gridBits - 3) steps; its digits reach this far below a step. */
  val excessDigits: Int = (digits - (distanceBits - 1)).max(0)

  /** Zeros that lengthen a short quotient to a step. */
  val missingDigits: Int = (distanceBits - 1 - digits).max(0)

  /** Bits dropped from a quotient: at most the numerator's leading zeros and the excess. */
  val dropBits: Int = NumberFormats.bitLength(numeratorBits + excessDigits)

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

/** Where the four-cycle schedule of a [[TriangleUnit]] stands: a triangle starts in phase 0, its vertices follow each
  * other. Phase 1 repeats while `advances` is false; registers of the shear and edge stages then hold.
  */
final class TriangleSchedule extends Bundle {
  val phase    = UInt(2.W)
  val advances = Bool()

  /** Phase 1 waits, in this cycle for the sake of whoever wants the shear's multipliers. */
  val pauses = Bool()

  def is(number: Int): Bool = phase === number.U
}

/** What a triangle is called while it is being tested. */
final class TriangleTag(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val id      = UInt(RecordFormats.idBits(config).W)
  val isLast  = Bool()

  /** It lets some light through. */
  val isClear = Bool()

  /** The record holds no triangle; this one stands in its place and misses. */
  val isAbsent = Bool()

  /** The ray's sign on its dominant axis. */
  val isNegative = Bool()
}

/** How far along the ray the vertices lie. */
final class TriangleDepths(formats: TriangleFormats) extends Bundle {
  val first = new Fixed(formats.grid)

  /** Of vertices 1 and 2, without the bits that all vertices have in common. */
  val rises = Vec(2, SInt(formats.riseBits.W))
}

/** A triangle that the ray's line crosses; magnitudes of its edge functions. */
final class CrossedTriangle(config: ColonnadeConfig) extends Bundle {
  private val formats = new TriangleFormats(config.numbers)

  val magnitudes = Vec(3, UInt(formats.edgeBits.W))
  val depths     = new TriangleDepths(formats)
  val id         = UInt(RecordFormats.idBits(config).W)
  val backSide   = Bool()
}

/** A crossed triangle with the barycentric weights of the crossing. */
final class WeightedTriangle(config: ColonnadeConfig) extends Bundle {
  private val formats = new TriangleFormats(config.numbers)

  val weights = Vec(3, UInt(formats.weightBits.W))

  /** Of the weights; its highest or second highest bit is set. */
  val sum      = UInt(formats.weightBits.W)
  val depths   = new TriangleDepths(formats)
  val id       = UInt(RecordFormats.idBits(config).W)
  val backSide = Bool()
}

/** A crossed triangle whose distance is one division away: t = first ± floor(dividend / divisor, drop). */
final class DistanceQuestion(config: ColonnadeConfig) extends Bundle {
  private val formats = new TriangleFormats(config.numbers)

  /** Zero, or its top bit is set. */
  val dividend = UInt(formats.mantissaBits.W)
  val divisor  = UInt(formats.mantissaBits.W)
  val terms    = new DistanceTerms(config)
}

/** What a distance needs besides the quotient. */
final class DistanceTerms(config: ColonnadeConfig) extends Bundle {
  private val formats = new TriangleFormats(config.numbers)

  /** Depth of vertex 0. */
  val first = new Fixed(formats.grid)

  /** The quotient is to be taken off. */
  val isNegative = Bool()
  val drop       = UInt(formats.dropBits.W)
  val id         = UInt(RecordFormats.idBits(config).W)
  val weights    = Vec(3, new Fixed(new RayFormats(config.numbers).weight))
  val backSide   = Bool()
}
