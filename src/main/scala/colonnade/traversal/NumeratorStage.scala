package colonnade.traversal

import chisel3._
import chisel3.util.{Cat, Decoupled}
import colonnade.config.PartConfig
import colonnade.numbers.{Fixed, Normalise, Rounding}
import colonnade.ray.RayFormats

final class NumeratorStageIO(config: PartConfig) extends Bundle {
  val weighted = Flipped(Decoupled(new WeightedTriangle(config)))
  val request  = Decoupled(new DistanceRequest(config))
}

/** Prepares the distance as a division of two mantissas; numbers.md 4.5.
  *
  * One triangle at a time, every 7 cycles: four multiplications of a weight by half a rise, magnitude, leading zeros, and
  * the shift in the output cycle.
  */
final class NumeratorStage(config: PartConfig) extends Module {
  val io = IO(new NumeratorStageIO(config))

  private object State extends ChiselEnum { val idle, multiplying, negating, counting, offering = Value }
  import State._

  private val numbers = config.numbers
  private val formats = new TriangleFormats(numbers)

  // Control
  private val state   = RegInit(idle)
  private val beat    = Reg(UInt(2.W))
  private val isFinal = beat === 3.U
  io.request.valid  := state === offering
  io.weighted.ready := state === idle || io.request.fire
  when(state === multiplying) {
    beat := beat + 1.U
    when(isFinal) { state := negating }
  }
  when(state === negating) { state := counting }
  when(state === counting) { state := offering }
  when(io.request.fire) { state := idle }
  when(io.weighted.fire) {
    state := multiplying
    beat  := 0.U
  }

  // Datapath
  private val triangle   = Reg(new WeightedTriangle(config))
  private val numerator  = Reg(SInt((formats.numeratorBits + 1).W))
  private val isNegative = Reg(Bool())
  private val zeros      = Reg(UInt(formats.zerosBits.W))

  // Multiply by the upper halves of the rises, then by the lower ones; an upper half is signed
  private val halfBits = (formats.riseBits + 1) / 2
  private val halves   = VecInit(
    triangle.depths.rises.map(Rounding.floor(_, halfBits).pad(halfBits + 1)) ++
      triangle.depths.rises.map(_.asUInt(halfBits - 1, 0).zext)
  )
  private val isSecond = beat(0)
  private val product  = Mux(isSecond, triangle.weights(2), triangle.weights(1)).zext * halves(beat)
  private val soFar    = Mux(beat === 0.U, 0.S, Mux(isSecond, numerator, (numerator << halfBits).asSInt))

  when(io.weighted.fire) { triangle := io.weighted.bits }
  when(state === multiplying) { numerator := Rounding.narrow(soFar +& product, formats.numeratorBits + 1) }
  when(state === negating) {
    isNegative := numerator < 0.S
    when(numerator < 0.S) { numerator := 0.S - numerator }
  }
  private val magnitude = numerator.asUInt(formats.numeratorBits - 1, 0)
  when(state === counting) { zeros := Normalise.countLeadingZeros(magnitude)._2 }

  private def mantissa(x: UInt): UInt = {
    val (width, bits) = (x.getWidth, formats.mantissaBits)
    if (width >= bits) x(width - 1, width - bits) else Cat(x, 0.U((bits - width).W))
  }

  // The difference of the exponents is gridBits - 3, minus the leading zeros of the numerator, plus the sum's
  // (at most one)
  private val sum     = triangle.sum
  private val isShort = !sum(formats.weightBits - 1)
  private val terms   = io.request.bits.terms
  io.request.bits.dividend := mantissa(TriangleFormats.shiftLeft(magnitude, zeros))
  io.request.bits.divisor  := mantissa(Mux(isShort, (sum << 1)(formats.weightBits - 1, 0), sum))
  terms.first              := triangle.depths.first
  terms.isNegative         := isNegative
  terms.shiftRight         := zeros +& formats.excessDigits.U - isShort
  terms.id                 := triangle.id
  terms.backSide           := triangle.backSide
  terms.weights.zip(triangle.weights).foreach { case (port, weight) =>
    val format = new RayFormats(numbers).weight
    port := Fixed(format, Rounding.floor(weight, formats.weightBits - numbers.barycentricBits))
  }
}
