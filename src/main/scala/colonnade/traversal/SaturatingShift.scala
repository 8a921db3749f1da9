package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, Cat, Fill}

/** Shifts sums of t right by `shiftRight`, at most `maxShift`, rounds towards minus infinity and saturates to
  * `resultBits`. Combinational.
  *
  * Only the bits that may reach the result are shifted. A mask detects overflow in the other bits without a shift; all
  * sums of an axis share it.
  */
final class SaturatingShift(shiftRight: UInt, maxShift: Int, resultBits: Int) {

  /** Bit j: bit j + resultBits - 1 of a sum is the result's sign bit or above it. */
  private val isAboveResult = VecInit(Seq.tabulate(maxShift + 1)(bit => bit.U >= shiftRight)).asUInt

  /** @param sum at least `resultBits` + `maxShift` + 1 bits */
  def apply(sum: SInt): SInt = {
    val width      = sum.getWidth
    val above      = width - resultBits - maxShift
    val isNegative = sum.head(1).asBool
    require(above >= 1, s"a sum of $width bits; expected at least ${resultBits + maxShift + 1}")
    val overflows = ((sum.asUInt(width - 2, resultBits - 1) ^ Fill(width - resultBits, isNegative)) &
      Cat(Fill(above - 1, 1.U), isAboveResult)(width - resultBits - 1, 0)).orR
    val saturated = Mux(isNegative, (-(BigInt(1) << (resultBits - 1))).S, ((BigInt(1) << (resultBits - 1)) - 1).S)
    Mux(overflows, saturated, shifted(sum))
  }

  /** Barrel shifter, the largest step first, so that each step is only as wide as the later ones need. */
  private def shifted(sum: SInt): SInt =
    (log2Ceil(maxShift + 1) - 1 to 0 by -1).foldLeft(sum) { (value, step) =>
      val needed   = resultBits + (1 << step) - 1
      val selected = Mux(shiftRight(step), value >> (1 << step), value)
      selected.asUInt(needed.min(selected.getWidth) - 1, 0).asSInt
    }
}
