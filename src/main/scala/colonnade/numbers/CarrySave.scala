package colonnade.numbers

import chisel3._

/** Adds without carrying: three terms become two with the same sum, modulo 2^width. */
object CarrySave {

  /** The sums and the carries of the bits of three terms of one width; `carryIn` is also added. */
  def apply(a: UInt, b: UInt, c: UInt, carryIn: Bool = false.B): (UInt, UInt) = {
    val width = a.getWidth
    require(b.getWidth == width && c.getWidth == width, s"terms of $width, ${b.getWidth} and ${c.getWidth} bits")
    (a ^ b ^ c, ((a & b) | (a & c) | (b & c))(width - 2, 0) ## carryIn)
  }
}
