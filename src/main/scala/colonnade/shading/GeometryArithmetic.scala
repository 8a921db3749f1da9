package colonnade.shading

import chisel3._
import chisel3.util.{Cat, Decoupled, Mux1H, PriorityEncoder, Reverse, ShiftRegister, Valid}
import colonnade.common.TimingSlice
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.numbers.Rounding

final class ShaderMultiplierIO(formats: ShaderFormats, hasCornerColours: Boolean) extends Bundle {
  val geometry = Flipped(Valid(new MultiplierOperands(formats)))     // has priority; never waits
  val colour   = Flipped(Decoupled(new MultiplierOperands(formats))) // uses the cycles that the geometry leaves free

  /** Uses the cycles that both leave free. */
  val corners = if (hasCornerColours) Some(Flipped(Decoupled(new MultiplierOperands(formats)))) else None

  val product = Output(SInt(formats.productBits.W)) // of the operands `latency` cycles before; for one cycle
}

/** The shader's only multiplier; exact products.
  *
  * Latency one or two cycles, one product per cycle. The geometry's program leaves a third of its cycles free, and all
  * cycles in which it waits for the cosine unit or the corner colours. So colours cannot starve.
  */
final class ShaderMultiplier(formats: ShaderFormats, hasCornerColours: Boolean, latency: Int = 1) extends Module {
  val io = IO(new ShaderMultiplierIO(formats, hasCornerColours))

  private val colour   = io.corners.map(corners => Mux(io.colour.valid, io.colour.bits, corners.bits))
  private val operands = Mux(io.geometry.valid, io.geometry.bits, colour.getOrElse(io.colour.bits))

  io.colour.ready := !io.geometry.valid
  io.corners.foreach(_.ready := !io.geometry.valid && !io.colour.valid)
  private val multiplied = ShiftRegister(operands, latency - 1)
  io.product := RegNext(multiplied.wide * multiplied.narrow)
}

object ShaderMultiplier {

  /** Cycles from operands to the product. An extra slice registers the operands; corner colours do not wait for it. */
  def latency(config: PathConfig): Int =
    if (config.device.geometry.cornerColours) 1 else 1 + TimingSlice.extra(config.device).cycles
}

final class GeometryAccumulatorIO(config: PathConfig) extends Bundle {
  private val formats = new ShaderFormats(config.numbers)

  // See [[GeometryControl]]
  val accumulate       = Input(Bool())
  val startSum         = Input(Bool())
  val shiftAccumulator = Input(Bool())
  val roundShear       = Input(Bool())

  val product = Input(SInt(formats.productBits.W))
  val sum     = Output(SInt((formats.productBits + 1).W))
  val rounded = Output(SInt(ShaderFormats.originBits(config).W)) // the sum of the cycle before, rounded

  /** The sum as a squared length, see [[Angle]]. */
  val mantissa = Output(UInt(formats.shadeBits.W))
  val exponent = Output(UInt(2.W))
}

/** Adds up products, and rounds sums to the nearest even number. */
final class GeometryAccumulator(config: PathConfig) extends Module {
  private val formats   = new ShaderFormats(config.numbers)
  private val shadeBits = formats.shadeBits

  val io = IO(new GeometryAccumulatorIO(config))

  private val sum = Reg(chiselTypeOf(io.sum))

  /** Bits that were shifted out of the sum: the highest one, and whether any other was set. */
  private val half   = Reg(Bool())
  private val sticky = Reg(Bool())

  private val lowDigit = sum.asUInt(shadeBits - 1, 0)
  private val previous = Mux(io.startSum, 0.S, Mux(io.shiftAccumulator, sum >> shadeBits, sum))
  when(io.accumulate) {
    sum    := Rounding.narrow(previous + io.product, sum.getWidth)
    half   := io.shiftAccumulator && lowDigit(shadeBits - 1)
    sticky := io.shiftAccumulator && (lowDigit(shadeBits - 2, 0).orR || half || sticky)
  }
  io.sum := sum

  // Both kinds of sum are aligned so that the same number of bits is dropped
  private val shearDrop  = config.numbers.shearFraction - shadeBits * (formats.shearDigits - 1) + 2
  private val normalDrop = NumberFormats.normalFraction
  private val drop       = shearDrop.max(normalDrop)
  private val shearSum   = (Cat(sum.asUInt, half, sticky).asSInt << (drop - shearDrop)).asSInt
  private val normalSum  = (sum << (drop - normalDrop)).asSInt
  private val rounded    = Reg(chiselTypeOf(io.rounded))
  rounded    := Rounding.narrow(Rounding.nearestEven(Mux(io.roundShear, shearSum, normalSum), drop), rounded.getWidth)
  io.rounded := rounded

  // The highest bit of a squared length is one of the top four
  private val top = sum.asUInt(formats.dotBits - 1, formats.dotBits - 4)
  io.exponent := Mux(top(3, 1).orR, 3.U - PriorityEncoder(Reverse(top(3, 1))), 0.U)
  io.mantissa :=
    Mux1H((0 to 3).map(k => (io.exponent === k.U) -> sum.asUInt(k + 2 * shadeBits - 2, k + shadeBits - 1)))
}

/** A vector of three signed components in registers that rotate. Its user reads component 0 and rotates the vector.
  * After three uses each component is back in its place, so no component is ever selected.
  */
private[shading] object VectorRegister {
  def apply(bits: Int): Vec[SInt] = Reg(Vec(3, SInt(bits.W)))

  /** Components 1 and 2 move down, and this one enters behind them: a new component, or component 0 again. */
  def rotate(vector: Vec[SInt], entering: SInt): Unit = {
    vector(0) := vector(1)
    vector(1) := vector(2)
    vector(2) := Rounding.narrow(entering, vector(2).getWidth)
  }
}
