package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Cat}
import colonnade.config.NumberFormats

/** Parts of a whole, channel by channel: a bit of the quotient a cycle. */
final private[shading] class Ratios(bits: Int) {
  private val fraction  = NumberFormats.lightFraction
  private val remainder = Reg(UInt(bits.W))
  private val bitsLeft  = RegInit(0.U(log2Ceil(fraction + 1).W))
  private val channel   = Reg(UInt(2.W))

  val isWanted: Bool      = Reg(Bool())
  val whole:    UInt      = Reg(UInt(bits.W))
  val found:    Vec[UInt] = Reg(Vec(3, UInt((fraction + 1).W)))
  val isBusy:   Bool      = bitsLeft =/= 0.U

  /** All of it needs no division; a part is less than the whole. */
  def begin(part: UInt, ofChannel: UInt): Unit = when(isWanted) {
    remainder := part
    channel   := ofChannel
    when(part =/= whole) { bitsLeft := fraction.U }
    for (index <- 0 until 3) when(ofChannel === index.U) { found(index) := (1 << fraction).U }
  }

  /** In every cycle. */
  def work(): Unit = when(isBusy) {
    val twice = remainder << 1
    val fits  = twice >= whole
    remainder := Mux(fits, twice - whole, twice)
    bitsLeft  := bitsLeft - 1.U
    for (index <- 0 until 3) when(channel === index.U) { found(index) := Cat(found(index)(fraction - 1, 0), fits) }
  }
}
