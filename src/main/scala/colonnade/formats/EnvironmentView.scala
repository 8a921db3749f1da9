package colonnade.formats

import chisel3._
import colonnade.config.NumberFormats
import colonnade.numbers.{Fixed, FixedPointFormat}

/** The projection of the environment; docs/background.md.
  *
  * A position P in grid steps has the projection p = matrix · P + (offset << offsetShift), in steps of 2^-exponent. It
  * appears at the map's pixel 1024 · (p.x, p.y) / p.z, and its w, the plane map's unit over its depth, is 1 / p.z.
  */
final class EnvironmentView(numbers: NumberFormats) extends Bundle {
  val matrix = Vec(3, Vec3(SInt(numbers.macBits.W)))
  val offset = Vec3(SInt(numbers.macBits.W))

  /** Clamped to `sceneBits`. */
  val offsetShift = UInt(NumberFormats.bitLength(numbers.sceneBits).W)
  val exponent    = SInt((NumberFormats.bitLength(2 * numbers.sceneBits) + 1).W)

  /** Rotates a normal of the maps from view space to object space. */
  val rotation =
    Vec(3, Vec3(new Fixed(FixedPointFormat.signed(EnvironmentView.rotationBits, EnvironmentView.rotationFraction))))

  /** Half a pixel of the frame, in the map's 1024 pixels: the centre of pixel (x, y) is at (2x + 1, 2y + 1) of these.
    */
  val stepX = UInt((numbers.shadeBits + EnvironmentView.stepGuard).W)
  val stepY = UInt((numbers.shadeBits + EnvironmentView.stepGuard).W)

  /** Number of bounding planes, clamped to the size of their table. */
  val boundingPlanes = UInt(8.W)

  /** Rays that miss the object meet the environment; otherwise they have the background's colour. Only the pixels of
    * `window` show it directly; other background pixels have the background's colour and ratio 1.
    */
  val enabled = Bool()
  val window  = new PixelRect(numbers.coordinateBits)

  /** The environment hides the object where its point is nearer by more than the tolerance, in grid steps along the
    * ray's dominant axis.
    */
  val occlusion          = Bool()
  val occlusionTolerance = UInt((numbers.gridBits - 2).W)

  /** The frame's camera took the maps, so the pixel of the map follows from the frame's. Otherwise rays from
    * the camera march, and miss where the maps show nothing.
    */
  val isMapCamera = Bool()
}

object EnvironmentView {
  val rotationBits:     Int = 16
  val rotationFraction: Int = 14
  val stepGuard:        Int = 12 // fraction bits of a step beyond a position's in the map
}
