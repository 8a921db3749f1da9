package colonnade.numbers

import chisel3._
import chisel3.util.{log2Ceil, Cat}

/** A number as mantissa and exponent: mantissa · 2^(exponent - mantissaBits), without the bits that were floored.
  *
  * @param mantissa its top bit is set, unless the number is zero
  * @param exponent the number's bit length
  */
final class Normalised(mantissaBits: Int, exponentBits: Int) extends Bundle {
  val mantissa = UInt(mantissaBits.W)
  val exponent = UInt(exponentBits.W)
}

/** Normalisation, combinational: a tree counts the leading zeros, and log2(width) shifts remove them. */
object Normalise {

  /** Bits of the exponent of an operand of `width` bits. */
  def exponentBits(width: Int): Int = log2Ceil(width + 1)

  def apply(x: UInt, bits: Int): Normalised = {
    val (zero, zeros) = countLeadingZeros(x)
    apply(x, zero, zeros, bits)
  }

  /** With the results of [[countLeadingZeros]]. */
  def apply(x: UInt, zero: Bool, zeros: UInt, bits: Int): Normalised = {
    val width   = x.getWidth
    val shifted = shiftLeft(x, zeros)
    val result  = Wire(new Normalised(bits, exponentBits(width)))
    result.mantissa := (if (bits <= width) shifted(width - 1, width - bits) else Cat(shifted, 0.U((bits - width).W)))
    result.exponent := Mux(zero, 0.U, width.U(exponentBits(width).W) - zeros)
    result
  }

  /** Numbers of one width, shifted together until the largest fills `bits` and a sign, and floored; all are 0 if they
    * are.
    */
  def together(numbers: Seq[SInt], bits: Int): Seq[SInt] = {
    val width   = numbers.head.getWidth.max(bits + 1)
    val padded  = numbers.map(_.pad(width))
    val lengths = padded.map(x => Mux(x < 0.S, ~x, x).asUInt(width - 2, 0)).reduce(_ | _)
    val zeros   = countLeadingZeros(lengths)._2
    padded.map(x => shiftLeft(x.asUInt, zeros)(width - 1, width - 1 - bits).asSInt)
  }

  /** As wide as the number: the most negative one has its magnitude there. */
  def magnitude(x: SInt): UInt = Mux(x < 0.S, 0.S -% x, x).asUInt

  /** The position of the highest set bit plus one; 0 for zero. */
  def bitLength(x: UInt): UInt = {
    val (zero, zeros) = countLeadingZeros(x)
    Mux(zero, 0.U(exponentBits(x.getWidth).W), x.getWidth.U(exponentBits(x.getWidth).W) - zeros)
  }

  /** Whether all bits are clear; and the number of zeros above the highest set bit, which is meaningless for zero. */
  def countLeadingZeros(x: UInt): (Bool, UInt) = {
    val size = 1 << log2Ceil(x.getWidth)
    // Padding at the low end does not change the count if any bit of x is set
    tree(if (size == x.getWidth) x else Cat(x, 0.U((size - x.getWidth).W)))
  }

  private def tree(x: UInt): (Bool, UInt) =
    if (x.getWidth == 1) (!x(0), 0.U(0.W))
    else {
      val half               = x.getWidth / 2
      val (highZero, inHigh) = tree(x(2 * half - 1, half))
      val (lowZero, inLow)   = tree(x(half - 1, 0))
      val count              = Cat(highZero, Mux(highZero, inLow, inHigh))
      (highZero && lowZero, if (half == 1) highZero.asUInt else count)
    }

  private def shiftLeft(x: UInt, by: UInt): UInt = {
    val width = x.getWidth
    (by.getWidth - 1 to 0 by -1).foldLeft(x) { (value, step) =>
      val distance = 1 << step
      if (distance >= width) value else Mux(by(step), (value << distance)(width - 1, 0), value)
    }
  }
}

/** Scales vectors to the length of a stored normal, `one`: a table has the reciprocals of 128 lengths. A vector is then
  * at most `one` long and less than 1 % shorter, before its components are rounded.
  */
object UnitLength {
  val factorBits: Int = 10

  private val mantissaBits = 7

  /** A quarter of one / length, in the least power of two that is above the length.
    *
    * @param squared the squared length: its bits are 2 · `octave`, or one less
    * @param one the length of a stored normal
    */
  def factor(squared: UInt, octave: Int, one: Int): UInt = {
    val isOdd    = !squared(2 * octave - 1)
    val mantissa = Mux(
      isOdd,
      squared(2 * octave - 3, 2 * octave - 1 - mantissaBits),
      squared(2 * octave - 2, 2 * octave - mantissaBits)
    )
    VecInit(table(one).map(_.U(factorBits.W)))(Cat(isOdd, mantissa))
  }

  /** For the upper end of the squared lengths with a mantissa, whose top bit is set. */
  private def table(one: Int): Seq[BigInt] = for {
    shift <- Seq(3, 4)
    next  <- (1 << (mantissaBits - 1)) + 1 to 1 << mantissaBits
  } yield root((BigInt(one).pow(2) << shift) / next)

  private def root(x: BigInt): BigInt = BigInt(math.sqrt(x.toDouble).floor.toLong)
}
