package colonnade.bus

import chisel3._

/** Formats of a framebuffer; docs/bus-shell.md. Code 3 is illegal. */
object PixelFormat extends ChiselEnum {
  val xrgb8888, rgb565, linear16 = Value

  val maxBytes: Int = 8

  /** The base-2 logarithm of a pixel's bytes. */
  def bytesLog(format: UInt): UInt =
    Mux(format === rgb565.litValue.U, 1.U, Mux(format === linear16.litValue.U, 3.U, 2.U(2.W)))

  def isLegal(format: UInt): Bool = format <= linear16.litValue.U
}
