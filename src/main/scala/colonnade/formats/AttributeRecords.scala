package colonnade.formats

import chisel3._
import colonnade.config.{AttributeLayout, NumberFormats}
import colonnade.numbers.{Fixed, FixedPointFormat}

/** A tile of a two-level map.
  *
  * Modes 0 to 3 choose between two entries, for cells of a half, a quarter, an eighth or a sixteenth of the tile's
  * edge; modes 4 to 7 between four, for the same cells. A mask has one or two bits a cell, row by row from the low bit;
  * it begins at the heap word `pointer`, or with four entries behind it: that word itself holds entries 2 (low byte) and
  * 3. In mode 0 the mask is the low bits of `pointer`.
  */
final class MapDescriptor extends Bundle {
  val entries = Vec(2, UInt(AttributeLayout.indexBits.W))
  val pointer = UInt(AttributeLayout.pointerBits.W)
  val mode    = UInt(AttributeLayout.modeBits.W)
}

/** Linear. */
final class AlbedoEntry extends Bundle {
  val b = FrameRegisters.colour
  val g = FrameRegisters.colour
  val r = FrameRegisters.colour
}

/** A unit normal in view space: x to the right, y down, z forward. */
final class NormalEntry extends Bundle {
  private def component = new Fixed(FixedPointFormat.signed(NumberFormats.normalBits, NumberFormats.normalFraction))

  val z = component
  val y = component
  val x = component
}

/** A tile of the plane map. Mode 0: all of the tile lies in the plane `pointer`. Modes 1 and 2: of two planes, for cells
  * of a quarter or an eighth of the tile's edge; the heap word `pointer` holds their ids (0 in the low byte), the mask
  * follows. Modes 3 and 4: of four planes, for the same cells; two words of ids, then the mask.
  */
final class PlaneDescriptor extends Bundle {
  val pointer = UInt(AttributeLayout.pointerBits.W)
  val mode    = UInt(AttributeLayout.modeBits.W)
}

/** A plane of inverse depths: `w = (a · (u − width/2) + b · (v − height/2)) / 1024 + c` at the pixel (u, v), each
  * coefficient times 2^(exponent − 22).
  */
final class Plane extends Bundle {
  private def coefficient = SInt(AttributeLayout.coefficientBits.W)

  val exponent = UInt(AttributeLayout.exponentBits.W)
  val c        = coefficient
  val b        = coefficient
  val a        = coefficient
}

/** A plane beyond the view, with the one colour and normal that it has. */
final class ShellEntry extends Bundle {
  val normal = new NormalEntry
  val albedo = new AlbedoEntry
  val plane  = new Plane
}
