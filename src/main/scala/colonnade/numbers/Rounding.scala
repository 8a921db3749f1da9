package colonnade.numbers

import chisel3._

/** All operations that drop bits. A negative amount shifts left, exactly. */
object Rounding {

  /** Drops `bits` low bits towards minus infinity. */
  def floor(x: SInt, bits: Int): SInt =
    if (bits <= 0) shiftedLeft(x, -bits) else (x >> bits.min(x.getWidth - 1)).asSInt

  /** Drops `bits` low bits. */
  def floor(x: UInt, bits: Int): UInt =
    if (bits <= 0) shiftedLeft(x, -bits) else if (bits >= x.getWidth) 0.U(1.W) else x(x.getWidth - 1, bits)

  /** Drops a variable number of low bits, towards minus infinity. */
  def floor(x: SInt, bits: UInt): SInt = x >> bits

  def floor(x: UInt, bits: UInt): UInt = x >> bits

  /** `floor`, as wide as the number, and whether it is inexact. */
  def floorInexact(x: UInt, bits: UInt): (UInt, Bool) = {
    val width = x.getWidth
    (0 until bits.getWidth).foldLeft((x, false.B)) { case ((value, inexact), step) =>
      val dropped = (BigInt(1) << step).min(width).toInt
      val shifted = if (dropped == width) 0.U(width.W) else (value >> dropped).pad(width)
      (Mux(bits(step), shifted, value), inexact || (bits(step) && value(dropped - 1, 0).orR))
    }
  }

  /** Drops `bits` low bits to nearest, ties to even; one bit wider than `floor`, for the carry. */
  def nearestEven(x: SInt, bits: Int): SInt =
    if (bits <= 0) shiftedLeft(x, -bits)
    else {
      val wide = x.pad(bits + 1)
      floor(wide, bits) +& roundsUp(wide, bits).zext
    }

  /** Drops `bits` low bits to nearest, ties to even; one bit wider than `floor`, for the carry. */
  def nearestEven(x: UInt, bits: Int): UInt =
    if (bits <= 0) shiftedLeft(x, -bits)
    else {
      val wide = x.pad(bits + 1)
      floor(wide, bits) +& roundsUp(wide, bits)
    }

  /** The nearest value of a signed integer of `width` bits. */
  def saturate(x: SInt, width: Int): SInt = saturate(x, -(BigInt(1) << (width - 1)), (BigInt(1) << (width - 1)) - 1)

  /** The nearest value of an unsigned integer of `width` bits. */
  def saturate(x: UInt, width: Int): UInt =
    if (x.getWidth <= width) x
    else Mux(x(x.getWidth - 1, width).orR, ((BigInt(1) << width) - 1).U(width.W), x(width - 1, 0))

  /** The nearest value from `low` to `high`, with the bits that this range needs. */
  def saturate(x: SInt, low: BigInt, high: BigInt): SInt = {
    require(low <= high, s"saturation from $low to $high")
    val width = (low.bitLength.max(high.bitLength) + 1).min(x.getWidth)
    val min   = -(BigInt(1) << (x.getWidth - 1))
    val max   = -min - 1
    if (low <= min && high >= max) x
    else {
      val wide    = x.pad(low.bitLength.max(high.bitLength) + 1)
      val limited = Mux(wide < low.S, low.S, Mux(wide > high.S, high.S, wide))
      narrow(limited, width.max(low.bitLength + 1).max(high.bitLength + 1))
    }
  }

  /** The low bits. The caller guarantees that the others are copies of the sign. */
  def narrow(x: SInt, width: Int): SInt = if (x.getWidth <= width) x else x.asUInt(width - 1, 0).asSInt

  /** The low bits. The caller guarantees that the others are zero. */
  def narrow(x: UInt, width: Int): UInt = if (x.getWidth <= width) x else x(width - 1, 0)

  /** `floor` to the fraction bits of a format whose range includes the number's. */
  def floor(x: Fixed, to: FixedPointFormat): Fixed = fitted(floor(x.integer, x.format.fraction - to.fraction), x, to)

  /** `nearestEven` to the fraction bits of a format whose range includes the number's. */
  def nearestEven(x: Fixed, to: FixedPointFormat): Fixed =
    fitted(nearestEven(x.integer, x.format.fraction - to.fraction), x, to)

  /** `floor` to the fraction bits of a format, then the nearest value in its range. */
  def saturate(x: Fixed, to: FixedPointFormat): Fixed =
    Fixed.fromLowBits(to, saturate(floor(x.integer, x.format.fraction - to.fraction), to.lowest, to.highest))

  private def fitted(rounded: SInt, x: Fixed, to: FixedPointFormat): Fixed = {
    val needed    = rounded.getWidth - (if (x.format.signed) 0 else 1)
    val available = to.width - (if (to.signed && !x.format.signed) 1 else 0)
    require(to.signed || !x.format.signed, s"a signed ${x.format} does not fit $to")
    require(needed <= available, s"${x.format} rounded to ${to.fraction} fraction bits does not fit $to; saturate it")
    Fixed.fromLowBits(to, rounded)
  }

  private def shiftedLeft(x: SInt, bits: Int): SInt = if (bits == 0) x else (x << bits).asSInt

  private def shiftedLeft(x: UInt, bits: Int): UInt = if (bits == 0) x else (x << bits).asUInt

  /** Whether `nearestEven` is one above `floor`. */
  def roundsUp(x: SInt, bits: Int): Bool = if (bits <= 0) false.B else roundsUp(x.pad(bits + 1).asUInt, bits)

  /** The dropped bits are more than half a step, or exactly half a step above an odd number. */
  private def roundsUp(x: UInt, bits: Int): Bool = {
    val half   = x(bits - 1)
    val sticky = if (bits == 1) false.B else x(bits - 2, 0).orR
    half && (sticky || x(bits))
  }
}
