package colonnade.formats

import chisel3._
import colonnade.config.{AttributeLayout, NumberFormats}
import colonnade.numbers.{Fixed, FixedPointFormat}

/** A tile of a two-level map.
  *
  * Modes 0 to 3 select one of two entries per cell; a cell's edge is a half, a quarter, an eighth or a sixteenth of the
  * tile's. Modes 4 to 7 select one of four entries, for the same cells. The mask has one or two bits per cell, row by row
  * from the low bit. It starts at the heap word `pointer`. With four entries, that word holds entries 2 (low byte) and 3,
  * and the mask follows. In mode 0 the mask is the low bits of `pointer`.
  */
final class MapDescriptor extends Bundle {
  val entries = Vec(2, UInt(AttributeLayout.indexBits.W))
  val pointer = UInt(AttributeLayout.pointerBits.W)
  val mode    = UInt(AttributeLayout.modeBits.W)
}

/** A linear colour. */
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

/** A tile of the plane map.
  *
  * Mode 0: the whole tile lies in the plane `pointer`. Modes 1 and 2: two planes, for cells of a quarter or an eighth of
  * the tile's edge; the heap word `pointer` holds their ids (0 in the low byte), the mask follows. Modes 3 and 4: four
  * planes, for the same cells; two words of ids, then the mask. Modes 5 and 6: two and four planes, for cells of a
  * sixteenth of the tile's edge.
  */
final class PlaneDescriptor extends Bundle {
  val pointer = UInt(AttributeLayout.pointerBits.W)
  val mode    = UInt(AttributeLayout.modeBits.W)
}

/** A plane of inverse depths: `w = (a · (u − width/2) + b · (v − height/2)) / 1024 + c` at the pixel (u, v), with
  * each coefficient scaled by 2^(exponent − 22).
  */
final class Plane extends Bundle {
  private def coefficient = SInt(AttributeLayout.coefficientBits.W)

  val exponent = UInt(AttributeLayout.exponentBits.W)
  val c        = coefficient
  val b        = coefficient
  val a        = coefficient
}

/** A bounding plane outside the view, with its one colour and normal. */
final class BoundingPlaneEntry extends Bundle {
  val normal = new NormalEntry
  val albedo = new AlbedoEntry
  val plane  = new Plane
}
