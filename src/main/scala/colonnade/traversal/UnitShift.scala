package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, Fill}
import colonnade.config.NumberFormats

/** Converts products of a distance and a reciprocal to whole units. It shifts the full product right by `shiftRight`
  * (at most `reciprocalFraction`), rounds towards minus infinity and saturates to `boxDistanceBits`. Combinational.
  *
  * Only the bits that may reach the result are shifted. A mask detects overflow in the other bits without a shift; all
  * products of an axis share it.
  */
final class UnitShift(shiftRight: UInt, numbers: NumberFormats) {
  private val resultBits = numbers.boxDistanceBits
  private val maxShift   = numbers.reciprocalFraction

  /** Bit j: bit j + resultBits - 1 of a product is the result's sign bit or above it. */
  private val isAboveResult = VecInit(Seq.tabulate(maxShift + 1)(bit => bit.U >= shiftRight)).asUInt

  /** @param product without the low bits that are 0 in every reciprocal */
  def apply(product: SInt): SInt = {
    val zeroBits = numbers.reciprocalFraction - numbers.reciprocalDigits
    val whole    = if (zeroBits == 0) product else (product << zeroBits).asSInt
    require(
      whole.getWidth == resultBits + maxShift + 1,
      s"a product of ${whole.getWidth} bits; expected ${resultBits + maxShift + 1}"
    )

    val isNegative = whole.head(1).asBool
    val overflows  =
      ((whole.asUInt(resultBits + maxShift - 1, resultBits - 1) ^ Fill(maxShift + 1, isNegative)) & isAboveResult).orR
    val saturated = Mux(isNegative, (-(BigInt(1) << (resultBits - 1))).S, ((BigInt(1) << (resultBits - 1)) - 1).S)
    Mux(overflows, saturated, shifted(whole))
  }

  /** Barrel shifter, the largest step first, so that each step is only as wide as the later ones need. */
  private def shifted(whole: SInt): SInt =
    (log2Ceil(maxShift + 1) - 1 to 0 by -1).foldLeft(whole) { (value, step) =>
      val needed   = resultBits + (1 << step) - 1
      val selected = Mux(shiftRight(step), value >> (1 << step), value)
      selected.asUInt(needed.min(selected.getWidth) - 1, 0).asSInt
    }
}
