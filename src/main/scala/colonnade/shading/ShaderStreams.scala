package colonnade.shading

import chisel3._
import colonnade.common.Context
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{Face, FrameRegisters, Rgb, Vec3}
import colonnade.numbers.Fixed
import colonnade.ray.{RayFormats, TriangleRay}
import colonnade.traversal.HitPoint

/** A hit to shade. */
final class ShadeRequest(config: PathConfig) extends Bundle {
  val context = Context(config)
  val ray     = new TriangleRay(config.numbers)
  val hit     = new HitPoint(config)
  val face    = new Face(config.device)
}

/** A point of the environment, to be lit like a diffuse surface. */
final class EnvironmentSurface(config: PathConfig) extends Bundle {
  val context = Context(config)
  val point   = Vec3(new Fixed(new RayFormats(config.numbers).scene))
  val normal  = Vec3(SInt(NumberFormats.normalBits.W))
  val albedo  = Rgb(FrameRegisters.colour)
  val shadows = Bool() // send shadow rays
}

/** A diffuse surface and its direct light, before shadow rays from `origin` have been traced. */
final class LitSurface(config: PathConfig) extends Bundle {
  val context = Context(config)
  val albedo  = Rgb(FrameRegisters.colour)
  val origin  = Vec3(new Fixed(new RayFormats(config.numbers).scene))

  /** By light; 0 from a light that is off. */
  val directLight     = Vec(config.device.frame.lights, Rgb(FrameRegisters.intensity))
  val needsShadowRays = Vec(config.device.frame.lights, Bool())

  val emission =
    Option.when(config.device.frame.emission)(Rgb(FrameRegisters.colour)) // the light that the surface adds
  val scatter = Option.when(config.device.frame.gather)(ScatterStage.dir) // of the ray that gathers light there

  val isOfEnvironment = Bool()
}

/** A ray that leaves a mirror or glass. */
final class BouncedRay(config: PathConfig) extends Bundle {
  val bounce   = new BounceResult(config)
  val albedo   = Rgb(FrameRegisters.colour)
  val isTinted = Bool() // the path is tinted by the albedo

  /** Where there may be an environment: the origin of the Fresnel reflection, off the surface on the ray's side. */
  val fresnelOrigin = Option.when(config.device.hasEnvironment)(bounce.origin.cloneType)
}
