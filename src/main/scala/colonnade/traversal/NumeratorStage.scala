package colonnade.traversal

import chisel3._
import chisel3.util.{Cat, Decoupled}
import colonnade.config.ColonnadeConfig
import colonnade.numbers.{Fixed, Normalise, Rounding}
import colonnade.ray.RayFormats

final class NumeratorStageIO(config: ColonnadeConfig) extends Bundle {
  private val formats = new TriangleFormats(config.numbers)

  val weighted = Flipped(Decoupled(new WeightedTriangle(config)))

  /** Multiplications for the shear stage; `products` is valid in the cycle after one was accepted. */
  val weighing = Decoupled(new WeighingOperands(formats))
  val products = Input(Vec(2, SInt((2 * config.numbers.gridBits).W)))
  val request  = Decoupled(new DistanceRequest(config))
}

/** Prepares the distance as a division of two mantissas; numbers.md 4.5.
  *
  * One triangle at a time, every 5 cycles plus at most 3 cycles of wait for the shared multipliers: products, sum,
  * magnitude, leading zeros, and the shift in the output cycle.
  */
final class NumeratorStage(config: ColonnadeConfig) extends Module {
  val io = IO(new NumeratorStageIO(config))

  private object State extends ChiselEnum { val idle, multiplying, adding, negating, counting, offering = Value }
  import State._

  private val numbers = config.numbers
  private val formats = new TriangleFormats(numbers)

  // Control
  private val state = RegInit(idle)
  io.weighing.valid := state === multiplying
  io.request.valid  := state === offering
  io.weighted.ready := state === idle || io.request.fire
  when(io.weighing.fire) { state := adding }
  when(state === adding) { state := negating }
  when(state === negating) { state := counting }
  when(state === counting) { state := offering }
  when(io.request.fire) { state := idle }
  when(io.weighted.fire) { state := multiplying }

  // Datapath
  private val triangle   = Reg(new WeightedTriangle(config))
  private val numerator  = Reg(SInt((formats.numeratorBits + 1).W))
  private val isNegative = Reg(Bool())
  private val zeros      = Reg(UInt(formats.zerosBits.W))

  when(io.weighted.fire) { triangle := io.weighted.bits }
  when(state === adding) {
    numerator := Rounding.narrow(io.products(0) +& io.products(1), formats.numeratorBits + 1)
  }
  when(state === negating) {
    isNegative := numerator < 0.S
    when(numerator < 0.S) { numerator := 0.S - numerator }
  }
  private val magnitude = numerator.asUInt(formats.numeratorBits - 1, 0)
  when(state === counting) { zeros := Normalise.countLeadingZeros(magnitude)._2 }

  io.weighing.bits.weights := VecInit(triangle.weights.tail)
  io.weighing.bits.rises   := triangle.depths.rises

  private def mantissa(x: UInt): UInt = {
    val (width, bits) = (x.getWidth, formats.mantissaBits)
    if (width >= bits) x(width - 1, width - bits) else Cat(x, 0.U((bits - width).W))
  }

  // The difference of the exponents is gridBits - 3, minus the leading zeros of the numerator, plus those of the sum
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
