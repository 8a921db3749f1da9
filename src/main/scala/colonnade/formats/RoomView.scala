package colonnade.formats

import chisel3._
import colonnade.config.NumberFormats
import colonnade.numbers.{Fixed, FixedPointFormat}

/** Where the room is; docs/background.md.
  *
  * A position P in grid steps has the projection p = matrix · P + (offset << offsetShift), in steps of 2^-exponent. It is
  * seen at the map's pixel 1024 · (p.x, p.y) / p.z, and its w, the plane map's unit over its depth, is 1 / p.z.
  */
final class RoomView(numbers: NumberFormats) extends Bundle {
  val matrix = Vec(3, Vec3(SInt(numbers.macBits.W)))
  val offset = Vec3(SInt(numbers.macBits.W))

  /** At most `sceneBits`, and counts as that if it is more. */
  val offsetShift = UInt(NumberFormats.bitLength(numbers.sceneBits).W)
  val exponent    = SInt((NumberFormats.bitLength(2 * numbers.sceneBits) + 1).W)

  /** Turns a normal of the maps, in view space, into object space. */
  val rotation = Vec(3, Vec3(new Fixed(FixedPointFormat.signed(RoomView.rotationBits, RoomView.rotationFraction))))

  /** Of the map's 1024 pixels, half a pixel of the frame: pixel (x, y)'s centre is at (2x + 1, 2y + 1) of these. */
  val stepX = UInt((numbers.shadeBits + RoomView.stepGuard).W)
  val stepY = UInt((numbers.shadeBits + RoomView.stepGuard).W)

  /** Entries of the shell; all of them if it is more. */
  val shellPlanes = UInt(8.W)

  /** Rays that meet nothing of the object meet the room; otherwise the background's colour. */
  val isThere = Bool()

  /** Pixels that show the room itself: only here. Elsewhere they have the background's colour and all the light. */
  val window = new PixelRect(numbers.coordinateBits)
}

object RoomView {
  val rotationBits:     Int = 16
  val rotationFraction: Int = 14

  /** Fraction bits of a step beyond those of a place in the map. */
  val stepGuard: Int = 12
}
