package colonnade.shading

import chisel3._
import chisel3.util.{Cat, Decoupled}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{FrameRegisters, Rgb}
import colonnade.numbers.{DigitRecurrence, Fixed, Rounding}
import colonnade.ray.RayFormats

final class CornerColoursIO(config: PathConfig) extends Bundle {
  private val formats = new ShaderFormats(config.numbers)

  /** Takes `weights` and `colours` of a hit; the unit must be done with the hit before, or that must not use it. */
  val start   = Input(Bool())
  val weights = Input(Vec(3, new Fixed(new RayFormats(config.numbers).weight)))

  val colours = Input(Vec(3, Rgb(FrameRegisters.colour))) // one per corner
  val isUsed = Input(Bool()) // the hit shows its corner colours; constant from the cycle after `start` to the next

  /** To the multiplier, whose product comes in the cycle after it took them. */
  val operands = Decoupled(new MultiplierOperands(formats))
  val product  = Input(SInt(formats.productBits.W))

  val isDone = Output(Bool()) // `colour` is complete; it holds until the next `start`
  val colour = Output(Rgb(FrameRegisters.colour))
}

/** Interpolates the colours at the corners of a face by the weights of a hit: docs/numbers.md, 5.10.
  *
  * The weights do not add up to one, so each channel is a quotient: the weighted sum of the corners over the sum of the
  * weights, rounded to nearest. It lies between the corners, and equal corners give their colour.
  *
  * One hit at a time: nine products, then twelve cycles in which three restoring dividers find a bit each of their
  * channel. Latency 23 cycles from `start`, and one for each cycle in which the multiplier takes other operands. No
  * product is asked for when the hit does not use the colours.
  */
final class CornerColours(config: PathConfig) extends Module {
  private val colourBits = NumberFormats.colourBits
  private val weightBits = config.numbers.barycentricBits
  private val totalBits  = weightBits + 2
  private val products   = 9

  val io = IO(new CornerColoursIO(config))

  private val weights = Reg(Vec(3, UInt(weightBits.W))) // they rotate; component 0 is used

  /** Channel by channel; component 0 is used, then the others move down. */
  private val colours = Reg(Vec(products, UInt(colourBits.W)))
  private val total   = RegNext(weights.reduce(_ +& _).pad(totalBits))

  /** Products asked for, and bits found. */
  private val asked = RegInit(products.U(4.W))
  private val found = Reg(UInt(4.W))

  // The hit's material is known in the cycle after its start
  private val isUsed = RegNext(io.isUsed, false.B)
  io.operands.valid       := isUsed && asked =/= products.U
  io.operands.bits.wide   := weights(0).zext.pad(io.operands.bits.wide.getWidth)
  io.operands.bits.narrow := colours(0).zext.pad(io.operands.bits.narrow.getWidth)
  when(io.operands.fire) {
    asked := asked + 1.U
    weights.zip(weights.tail :+ weights.head).foreach { case (to, from) => to := from }
    colours.zip(colours.tail).foreach { case (to, from) => to := from }
  }

  /** Sums by channel, red first once all are there; then what is left of the division, above the bits found so far. */
  private val sums      = Reg(Vec(3, UInt((totalBits + colourBits).W)))
  private val isPending = RegNext(io.operands.fire, false.B)
  private val isFirst   = RegNext(asked === 0.U || asked === 3.U || asked === 6.U)
  private val isDivided = asked === products.U && !isPending && found =/= colourBits.U
  when(isPending) {
    // Half of the divisor rounds the quotient
    sums(2) := Mux(isFirst, total >> 1, sums(2)) + io.product.asUInt(weightBits + colourBits - 1, 0)
    when(isFirst) {
      sums(0) := sums(1)
      sums(1) := sums(2)
    }
  }
  when(isDivided) {
    found := found + 1.U
    for (sum <- sums) {
      val (fits, left) = DigitRecurrence.step(sum.head(totalBits + 1), total, totalBits)
      sum := Cat(left, sum(colourBits - 2, 0), fits)
    }
  }

  when(io.start) {
    asked   := 0.U
    found   := 0.U
    weights := VecInit(io.weights.map(_.natural))
    val byChannel = io.colours.map(_.channels).transpose
    colours := VecInit(byChannel.flatten)
  }

  io.isDone := found === colourBits.U
  io.colour.channels.zip(sums).foreach { case (to, sum) => to := Rounding.narrow(sum(colourBits - 1, 0), colourBits) }
}
