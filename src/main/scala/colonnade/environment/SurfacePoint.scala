package colonnade.environment

import chisel3._
import chisel3.util.Fill
import colonnade.config.NumberFormats
import colonnade.formats.EnvironmentView
import colonnade.numbers.Rounding

/** Arithmetic of a point and its normal. */
object SurfacePoint {

  /** Bits of a sum of three products of a normal and a row of the rotation. */
  val rotationBits: Int = EnvironmentView.rotationBits + NumberFormats.normalBits + 2

  /** A component of the normal, from its sum. */
  def rotated(sum: SInt): SInt =
    Rounding.saturate(Rounding.nearestEven(sum, EnvironmentView.rotationFraction), NumberFormats.normalBits)

  /** A coordinate of `sceneBits` and one bit, clamped to half the scene's size. */
  def clamped(position: SInt): SInt = {
    val sceneBits = position.getWidth - 1
    val sign      = position(sceneBits)
    val isFar     = position(sceneBits - 1, sceneBits - 2) =/= Fill(2, sign)
    val max       = ((BigInt(1) << (sceneBits - 2)) - 1).S(sceneBits.W)
    Mux(isFar, Mux(sign, ~max, max), Rounding.narrow(position, sceneBits))
  }
}
