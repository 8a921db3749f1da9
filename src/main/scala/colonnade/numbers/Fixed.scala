package colonnade.numbers

import chisel3._
import chisel3.util.Cat

import scala.collection.immutable.SeqMap

/** The Q format of a number: its value is raw · 2^-fraction.
  *
  * @param width    bits, the sign included
  * @param fraction bits behind the point; negative if one step is larger than one
  * @param signed   two's complement
  */
final case class FixedPointFormat(width: Int, fraction: Int, signed: Boolean) {
  require(width >= 1, s"a number of $width bits; it must have at least 1")

  /** Bits before the point, without the sign. */
  def integerBits: Int = width - fraction - (if (signed) 1 else 0)

  def lowest: BigInt  = if (signed) -(BigInt(1) << (width - 1)) else BigInt(0)
  def highest: BigInt = (BigInt(1) << (if (signed) width - 1 else width)) - 1

  /** Integer and fraction bits, as in `q18_13`, `uq4_12`, `q18_m3` (m for minus): unique for each format. */
  def label: String = {
    def number(n: Int) = if (n < 0) s"m${-n}" else n.toString
    s"${if (signed) "q" else "uq"}${number(integerBits)}_${number(fraction)}"
  }

  override def toString: String = label
}

object FixedPointFormat {
  def signed(width: Int, fraction: Int): FixedPointFormat = FixedPointFormat(width, fraction, signed = true)

  def unsigned(width: Int, fraction: Int): FixedPointFormat = FixedPointFormat(width, fraction, signed = false)
}

/** A hardware number with its format. Its only field is named after the format, so connecting two different formats
  * fails at elaboration. Sums, differences and products are exact, in the format that holds them; only [[Rounding]]
  * drops bits.
  */
final class Fixed(val format: FixedPointFormat) extends Record {

  /** The raw bits: an `SInt` or a `UInt`. */
  val raw: Bits = if (format.signed) SInt(format.width.W) else UInt(format.width.W)

  val elements: SeqMap[String, Data] = SeqMap(format.label -> raw)

  /** The raw integer as an `SInt`; one bit wider if the format is unsigned. */
  def integer: SInt = raw match {
    case signed: SInt   => signed
    case unsigned: UInt => unsigned.zext
    case other          => throw new IllegalStateException(s"a raw number of type $other")
  }

  /** The raw integer of an unsigned format. */
  def natural: UInt = {
    require(!format.signed, s"$format is signed; use integer")
    raw.asUInt
  }

  def +(that: Fixed): Fixed = aligned(that)((a, b) => a +& b, growth = 1)

  def -(that: Fixed): Fixed = {
    val (a, b) = (exactlySigned, that.exactlySigned)
    a.aligned(b)((x, y) => x -& y, growth = 1)
  }

  def *(that: Fixed): Fixed = {
    val (a, b) = if (format.signed == that.format.signed) (this, that) else (exactlySigned, that.exactlySigned)
    val to = FixedPointFormat(a.format.width + b.format.width, a.format.fraction + b.format.fraction, a.format.signed)
    if (to.signed) Fixed(to, a.integer * b.integer) else Fixed(to, a.natural * b.natural)
  }

  def unary_- : Fixed = {
    val from = exactlySigned.format
    Fixed(from.copy(width = from.width + 1), 0.S -& integer.pad(from.width))
  }

  def <(that: Fixed): Bool = compared(that)(_ < _)

  def <=(that: Fixed): Bool = compared(that)(_ <= _)

  /** The same value in a signed format. */
  private def exactlySigned: Fixed =
    if (format.signed) this else Fixed(format.copy(width = format.width + 1, signed = true), integer)

  private def raised(fraction: Int): SInt = Rounding.floor(integer, format.fraction - fraction)

  private def compared(that: Fixed)(by: (SInt, SInt) => Bool): Bool = {
    val fraction = format.fraction.max(that.format.fraction)
    by(raised(fraction), that.raised(fraction))
  }

  private def aligned(that: Fixed)(by: (SInt, SInt) => SInt, growth: Int): Fixed = {
    val fraction                        = format.fraction.max(that.format.fraction)
    val signed                          = format.signed || that.format.signed
    def bits(of: FixedPointFormat): Int = of.width + fraction - of.fraction + (if (signed && !of.signed) 1 else 0)
    val to = FixedPointFormat(bits(format).max(bits(that.format)) + growth, fraction, signed)
    Fixed.fromLowBits(to, by(raised(fraction), that.raised(fraction)))
  }
}

object Fixed {

  /** A number from its raw integer, which must not be wider than the format; a narrower one is extended. */
  def apply(format: FixedPointFormat, raw: SInt): Fixed = {
    require(format.signed, s"$format is unsigned; its raw integer is a UInt")
    require(raw.getWidth <= format.width, s"a raw integer of ${raw.getWidth} bits does not fit $format")
    fromLowBits(format, raw)
  }

  def apply(format: FixedPointFormat, raw: UInt): Fixed = {
    require(!format.signed, s"$format is signed; its raw integer is an SInt")
    require(raw.getWidth <= format.width, s"a raw integer of ${raw.getWidth} bits does not fit $format")
    fromLowBits(format, raw.zext)
  }

  /** A constant, given as its raw integer. */
  def literal(format: FixedPointFormat, raw: BigInt): Fixed = {
    require(raw >= format.lowest && raw <= format.highest, s"the constant $raw does not fit $format")
    if (format.signed) apply(format, raw.S(format.width.W)) else apply(format, raw.U(format.width.W))
  }

  /** A number from an integer's low bits. The caller guarantees that the other bits are redundant. */
  private[numbers] def fromLowBits(format: FixedPointFormat, raw: SInt): Fixed = {
    val number = Wire(new Fixed(format))
    val bits   = raw.pad(format.width).asUInt(format.width - 1, 0)
    number.raw := (if (format.signed) bits.asSInt else bits)
    number
  }
}

/** A float32 number as in memory: mantissa · 2^(biased − 150), with the sign. Subnormal numbers count as 0. */
final class Float32 extends Bundle {
  val isNegative = Bool()
  val biased     = UInt(8.W)
  val fraction   = UInt(23.W)

  def isFinite: Bool = !biased.andR
  def isNan: Bool    = biased.andR && fraction.orR
  def isZero: Bool   = biased === 0.U

  /** Of 24 bits, the top one set; or 0. */
  def mantissa: UInt = Mux(isZero, 0.U, Cat(true.B, fraction))

  /** The number's magnitude as an integer in the order of floats, 0 for subnormal ones. */
  def magnitude: UInt = Mux(isZero, 0.U, Cat(biased, fraction))

  /** Whether this number, not NaN, is at most that; subnormal numbers as they are. */
  def isAtMost(that: Float32): Bool = {
    val (one, other) = (asUInt(30, 0), that.asUInt(30, 0))
    Mux(isNegative, !that.isNegative || one >= other, Mux(that.isNegative, (one | other) === 0.U, one <= other)) ||
    (one | other) === 0.U
  }
}

object Float32 {
  val mantissaBits: Int = 24

  /** The biased exponent of numbers from a half up to 1, mantissa · 2^−24. */
  val half: Int = 126

  def zero: Float32 = 0.U(32.W).asTypeOf(new Float32)
}
