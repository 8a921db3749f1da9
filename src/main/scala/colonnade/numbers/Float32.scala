package colonnade.numbers

import chisel3._
import chisel3.util.Cat

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
