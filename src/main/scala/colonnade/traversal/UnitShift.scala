package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, Fill}
import colonnade.config.NumberFormats

/** Brings products of a distance and a reciprocal to whole units: drops `drop` bits (at most `reciprocalFraction`) of
  * the whole product towards minus infinity and saturates to `boxDistanceBits`. Combinational.
  *
  * Only the bits that may reach the result are shifted. Whether the others say something new is seen without shifting
  * them, by a mask that all products of an axis share.
  */
final class UnitShift(drop: UInt, numbers: NumberFormats) {
  private val resultBits = numbers.boxDistanceBits
  private val most       = numbers.reciprocalFraction

  /** Bit j: is bit j + resultBits - 1 of a product above the result's sign bit, or that bit itself? */
  private val above = VecInit(Seq.tabulate(most + 1)(bit => bit.U >= drop)).asUInt

  /** @param product without the low bits that no reciprocal has */
  def apply(product: SInt): SInt = {
    val clear = numbers.reciprocalFraction - numbers.reciprocalDigits
    val whole = if (clear == 0) product else (product << clear).asSInt
    require(
      whole.getWidth == resultBits + most + 1,
      s"a product of ${whole.getWidth} bits; expected ${resultBits + most + 1}"
    )

    val isNegative = whole.head(1).asBool
    val overflows  = ((whole.asUInt(resultBits + most - 1, resultBits - 1) ^ Fill(most + 1, isNegative)) & above).orR
    val saturated  = Mux(isNegative, (-(BigInt(1) << (resultBits - 1))).S, ((BigInt(1) << (resultBits - 1)) - 1).S)
    Mux(overflows, saturated, shifted(whole))
  }

  /** The largest step first, so that each step is only as wide as the later ones need. */
  private def shifted(whole: SInt): SInt =
    (log2Ceil(most + 1) - 1 to 0 by -1).foldLeft(whole) { (value, step) =>
      val needed = resultBits + (1 << step) - 1
      val chosen = Mux(drop(step), value >> (1 << step), value)
      chosen.asUInt(needed.min(chosen.getWidth) - 1, 0).asSInt
    }
}
