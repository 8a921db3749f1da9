package colonnade.numbers

import chisel3._

/** A step of restoring division or square root: subtract, and keep the difference unless it is negative. */
object DigitRecurrence {

  /** The difference, and whether it is not negative. Operands that are padded more than the difference needs would make
    * firtool take the borrow for a constant.
    */
  def subtract(minuend: UInt, subtrahend: UInt): (Bool, UInt) = {
    val difference = minuend -& subtrahend
    (!difference.head(1).asBool, difference)
  }

  /** The digit, and what is left of the minuend, in `bits` bits. */
  def step(minuend: UInt, subtrahend: UInt, bits: Int): (Bool, UInt) = {
    val (fits, difference) = subtract(minuend, subtrahend)
    (fits, Mux(fits, difference, minuend)(bits - 1, 0))
  }
}
