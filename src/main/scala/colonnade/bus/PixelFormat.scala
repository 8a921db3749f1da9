package colonnade.bus

import chisel3._
import chisel3.util.{Fill, MuxLookup}

/** Formats of a framebuffer; docs/bus-shell.md. Code 3 is illegal. */
object PixelFormat extends ChiselEnum {
  val xrgb8888, rgb565, linear16 = Value

  val maxBytes: Int = 8

  /** The base-2 logarithm of a pixel's bytes. */
  def bytesLog(format: UInt): UInt =
    Mux(format === rgb565.litValue.U, 1.U, Mux(format === linear16.litValue.U, 3.U, 2.U(2.W)))

  /** A pixel in a format: its sRGB codes, its linear channels in 16 bits, and whether it shows the object. */
  def packed(format: UInt, codes: Seq[UInt], linear: Seq[UInt], isObject: Bool): UInt = {
    val Seq(r, g, b) = codes
    val xrgb         = 255.U(8.W) ## r ## g ## b
    val rgb565       = r(7, 3) ## g(7, 2) ## b(7, 3)
    val linear16     = Fill(16, isObject) ## linear(2) ## linear(1) ## linear(0)
    MuxLookup(format, xrgb)(Seq(this.rgb565.litValue.U -> rgb565, this.linear16.litValue.U -> linear16))
      .pad(8 * maxBytes)
  }

  def isLegal(format: UInt): Bool = format <= linear16.litValue.U
}
