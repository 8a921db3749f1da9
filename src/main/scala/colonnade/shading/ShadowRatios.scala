package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled, Valid}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.numbers.{DigitRecurrence, Fixed}

/** The light that arrives at a surface, in one channel. */
final class ShadowRatioRequest(bits: Int) extends Bundle {
  val part    = UInt(bits.W)
  val channel = UInt(2.W)
}

/** Ports of [[ShadowRatios]].
  *
  * @param bits of the light that arrives at a surface, in one channel
  */
final class ShadowRatiosIO(config: PathConfig, bits: Int) extends Bundle {

  /** A pixel claims the unit, only while it is not busy. Its channels follow from three cycles later on, then its
    * colour.
    */
  val claim = Input(Bool())
  val busy  = Output(Bool())

  /** A channel, in the order 0, 1, 2; and its light without the object, at least `part` unless points of the
    * environment gather.
    */
  val load  = Flipped(Valid(new ShadowRatioRequest(bits)))
  val whole = Input(UInt(bits.W))

  val colour = Flipped(Valid(new PathColour(config))) // within 12 cycles after the last channel; its ratio is ignored
  val result = Decoupled(new PathColour(config))      // with its ratio; taken in the cycle of its offer, or in the next
}

/** Shadow ratios of one pixel at a time, beside the stream of [[ColourUnit]]: three dividers, one quotient bit a cycle
  * each. The result is offered 13 cycles after the last channel. A ratio of 2 or more is the largest number.
  */
final class ShadowRatios(config: PathConfig, bits: Int) extends Module {
  private val fraction  = NumberFormats.lightFraction
  private val mayExceed = PathEnd.has(config, PathEnd.gathered) // a part its whole

  val io = IO(new ShadowRatiosIO(config, bits))

  private val isClaimed = RegInit(false.B)
  private val isLoaded  = RegInit(false.B)
  private val bitsLeft  = Reg(UInt(log2Ceil(fraction + 1).W))
  private val pixel     = Reg(new PathColour(config))
  private val isLast    = io.load.valid && io.load.bits.channel === 2.U
  when(io.claim) { isClaimed := true.B }.elsewhen(isLast) { isClaimed := false.B }
  when(io.colour.valid) { pixel := io.colour.bits }
  when(isLast) {
    isLoaded := true.B
    bitsLeft := fraction.U
  }.elsewhen(io.result.fire) { isLoaded := false.B }
  private val divides = isLoaded && bitsLeft =/= 0.U
  when(divides) { bitsLeft := bitsLeft - 1.U }

  // The integer digit of a channel that comes
  private val part           = io.load.bits.part
  private val isOne          = part === io.whole
  private val (digit, above) = if (mayExceed) DigitRecurrence.step(part, io.whole, bits) else (false.B, part)
  private val isTooLarge     = if (mayExceed) above >= io.whole else false.B

  private val ratios = Seq.tabulate(3) { channel =>
    val whole     = Reg(UInt(bits.W))
    val remainder = Reg(UInt(bits.W))
    val ratio     = Reg(UInt((fraction + 1).W))

    val isKnown      = Reg(Bool()) // the ratio needs no division
    val (fits, rest) = DigitRecurrence.step((remainder << 1).asUInt, whole, bits)
    when(divides && !isKnown) {
      remainder := rest
      ratio     := Cat(ratio(fraction - 1, 0), fits)
    }
    when(io.load.valid && io.load.bits.channel === channel.U) {
      whole     := io.whole
      remainder := above
      ratio     := Mux(isOne, (1 << fraction).U, Mux(isTooLarge, ((2 << fraction) - 1).U, digit))
      isKnown   := isOne || isTooLarge
    }
    ratio
  }

  // The result has left when the first channel comes
  io.busy := isClaimed || (isLoaded && bitsLeft > 2.U)
  assert(!io.load.valid || !isLoaded || io.result.fire, "a channel before the result has left")
  io.result.valid := isLoaded && bitsLeft === 0.U
  io.result.bits  := pixel
  for (to <- io.result.bits.ratio)
    to.channels.zip(ratios).foreach { case (to, ratio) => to := Fixed(to.format, ratio) }
}
