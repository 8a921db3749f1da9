package colonnade.shading

import chisel3._
import colonnade.common.Context
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{Face, FrameRegisters, Rgb, Vec3}
import colonnade.numbers.Fixed
import colonnade.ray.{RayFormats, TriangleRay}
import colonnade.traversal.TriangleHit

/** A hit to shade. */
final class ShadeRequest(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val ray     = new TriangleRay(config.numbers)
  val hit     = new TriangleHit(config)
  val face    = new Face
}

/** A point of the room, to be lit like any diffuse surface. */
final class RoomSurface(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val point   = Vec3(new Fixed(new RayFormats(config.numbers).scene))
  val normal  = Vec3(SInt(NumberFormats.normalBits.W))
  val albedo  = Rgb(FrameRegisters.colour)

  /** Ask what is in the lights' way. */
  val shadows = Bool()
}

/** A diffuse surface and what each light gives to it, unless something is in its way; shadow rays, from `origin`, say
  * what.
  */
final class LitSurface(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val albedo  = Rgb(FrameRegisters.colour)
  val origin  = Vec3(new Fixed(new RayFormats(config.numbers).scene))

  /** By light; 0 from one that does not shine. */
  val directs         = Vec(config.frame.lights, Rgb(FrameRegisters.intensity))
  val needsShadowRays = Vec(config.frame.lights, Bool())
}

/** A ray that goes on from a mirror or from glass. */
final class BouncedRay(config: ColonnadeConfig) extends Bundle {
  val bounce = new BounceResult(config)
  val albedo = Rgb(FrameRegisters.colour)

  /** The path takes the material's colour. */
  val isTinted = Bool()

  /** Where what glass reflects comes from, if that may be a room: its ray starts off the surface, on the ray's side. */
  val beside = if (config.hasRoom) Some(Vec3(new Fixed(new RayFormats(config.numbers).scene))) else None
}
