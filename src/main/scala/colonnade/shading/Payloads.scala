package colonnade.shading

import chisel3._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Face, FrameRegisters, Rgb, Vec3}
import colonnade.numbers.Fixed
import colonnade.ray.{Context, RayFormats, TriangleRay}
import colonnade.traversal.TriangleHit

/** A hit to shade. */
final class ShadeRequest(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val ray     = new TriangleRay(config.numbers)
  val hit     = new TriangleHit(config)
  val face    = new Face
}

/** Both colours the pixel may have, and the shadow ray (from `origin` along `toLight`, grid steps) that decides. */
final class ShadeResult(config: ColonnadeConfig) extends Bundle {
  val context        = Context(config)
  val lit            = Rgb(FrameRegisters.colour)
  val ambient        = Rgb(FrameRegisters.colour)
  val needsShadowRay = Bool()
  val origin         = Vec3(new Fixed(new RayFormats(config.numbers).scene))
  val toLight        = Vec3(SInt(config.numbers.directionBits.W))
}
