package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Cat, Valid}
import colonnade.config.NumberFormats

/** The light that arrives at a surface, in one channel. */
final class ShadowRatioRequest(bits: Int) extends Bundle {
  val part    = UInt(bits.W)
  val channel = UInt(2.W)
}

/** Ports of [[ShadowRatioDivider]]. */
final class ShadowRatioDividerIO(bits: Int) extends Bundle {
  val start = Flipped(Valid(new ShadowRatioRequest(bits)))

  /** The light without shadows, in the channel; at least `part`, constant while the divider is busy. */
  val whole = Input(UInt(bits.W))
  val busy  = Output(Bool())

  /** part / whole by channel, with `lightFraction` fraction bits. */
  val ratios = Output(Vec(3, UInt((NumberFormats.lightFraction + 1).W)))
}

/** Shadow ratios of a pixel, channel by channel. One quotient bit a cycle; a ratio of 1 needs no division. */
final class ShadowRatioDivider(bits: Int) extends Module {
  private val fraction = NumberFormats.lightFraction

  val io = IO(new ShadowRatioDividerIO(bits))

  private val remainder = Reg(UInt(bits.W))
  private val bitsLeft  = RegInit(0.U(log2Ceil(fraction + 1).W))
  private val channel   = Reg(UInt(2.W))
  private val ratios    = Reg(chiselTypeOf(io.ratios))

  when(io.start.valid) {
    remainder := io.start.bits.part
    channel   := io.start.bits.channel
    when(io.start.bits.part =/= io.whole) { bitsLeft := fraction.U }
    for (index <- 0 until 3) when(io.start.bits.channel === index.U) { ratios(index) := (1 << fraction).U }
  }
  when(io.busy) {
    val twice = remainder << 1
    val fits  = twice >= io.whole
    remainder := Mux(fits, twice - io.whole, twice)
    bitsLeft  := bitsLeft - 1.U
    for (index <- 0 until 3) when(channel === index.U) { ratios(index) := Cat(ratios(index)(fraction - 1, 0), fits) }
  }
  io.busy   := bitsLeft =/= 0.U
  io.ratios := ratios
}
