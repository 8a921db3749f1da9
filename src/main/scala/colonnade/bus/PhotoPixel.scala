package colonnade.bus

import chisel3._
import chisel3.util.{RegEnable, ShiftRegister}
import colonnade.config.ColonnadeConfig
import colonnade.formats.FrameRegisters

/** A pixel of the photo times its shadow ratio, in the framebuffer's format; docs/bus-shell.md. One per cycle.
  *
  * The photo's sRGB code becomes 16 linear bits, by a table. The strength of the shadow moves the ratio to 1.0. Their product
  * is rounded to 16 bits.
  */
final class PhotoPixel(config: ColonnadeConfig) extends Module {
  import PhotoPixel._

  val enable = IO(Input(Bool()))
  val format = IO(Input(UInt(PixelFormat.getWidth.W)))

  /** See [[PixelWord]]: a shadow ratio, or a pixel that passes as it is. */
  val word = IO(Input(UInt(PixelWord.bits(config).W)))

  val photo = IO(Input(UInt(32.W))) // XRGB8888

  /** The highest byte of the photo is the strength of the shadow; otherwise it is whole. */
  val hasStrength = IO(Input(Bool()))

  val out = IO(Output(UInt((8 * PixelFormat.maxBytes).W)))

  private val ratioBits = FrameRegisters.weight.format.width
  private val fraction  = FrameRegisters.weight.format.fraction
  private val table     = VecInit(
    (0 until 1 << SrgbEncoder.codeBits).map(code => SrgbEncoder.decoded(code, linearBits).U(linearBits.W))
  )
  private val strength = RegEnable(Mux(hasStrength, photo(31, 24), whole.U(8.W)), enable)
  private val channels = Seq.tabulate(3) { channel =>
    val code    = photo(8 * (2 - channel) + 7, 8 * (2 - channel))
    val linear  = RegEnable(table(ShiftRegister(code, 2, enable)), enable)
    val shadow  = RegEnable(word(ratioBits * (channel + 1) - 1, ratioBits * channel), enable)
    val sum     = RegEnable(weighted(strength, shadow), enable)
    val ratio   = RegEnable(quotient(sum)(ratioBits - 1, 0), enable)
    val product = RegEnable(linear * ratio, enable)
    val rounded = (product +& (1 << (fraction - 1)).U) >> fraction
    val result  =
      RegEnable(Mux((rounded >> linearBits).orR, ((1 << linearBits) - 1).U, rounded(linearBits - 1, 0)), enable)
    val encoder = Module(new SrgbEncoder(linearBits))
    encoder.linear := result
    encoder.enable := enable
    (encoder.code, ShiftRegister(result, SrgbEncoder.latency, enable))
  }

  /** `strength` of `ratio` and the rest of 1.0, times 255; with the half that rounds, and the one of [[quotient]]. */
  private def weighted(strength: UInt, ratio: UInt): UInt =
    strength * ratio +& (~strength ## 0.U(fraction.W)) +& (whole / 2 + 1).U

  private val passed = ShiftRegister(word, latency, enable)
  private val mixed  = PixelFormat.packed(format, channels.map(_._1), channels.map(_._2), isObject = false.B)
  out := Mux(PixelWord.showsPhoto(passed), mixed, passed)
}

object PhotoPixel {
  val linearBits: Int = 16                      // of a linear channel of the photo; all ones is 1.0
  val latency:    Int = 5 + SrgbEncoder.latency // cycles from a pixel to its word
  val whole:      Int = 255                     // strength of a whole shadow

  /** (`sum` - 1) over 255, rounded down; `sum` is 1 to 2^21^. (2^24^ - 1) / 255 is 2^16^ + 2^8^ + 1. */
  def quotient(sum: UInt): UInt = ((sum ## 0.U(16.W)) +& (sum ## 0.U(8.W)) +& sum) >> 24
}
