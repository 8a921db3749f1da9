package colonnade.shading

import chisel3._
import colonnade.common.Context
import colonnade.config.PathConfig
import colonnade.formats.{FrameRegisters, Rgb}

/** The last surface of a path. */
final class PathTermination(config: PathConfig) extends Bundle {
  val context      = Context(config)
  val isBackground = Bool() // there is no surface: the path ends with the background's colour
  val isStraight = Option.when(config.frame.hasBounces)(Bool()) // the path's throughput is 1, its radiance 0
  val occlusions = Vec(config.frame.lights, Occlusion())        // by light: the shadow rays' outcomes

  /** The camera sees the environment's surface directly: the shadow ratio is needed as well. */
  val isDirectView = if (config.hasEnvironment) Some(Bool()) else None

  /** The surface gathers light: the path goes on, without ambient light. */
  val gathers = Option.when(config.frame.gather)(Bool())

  /** Without a surface, the path ends in the light cube; the path has gathered, so it does not see lights there. */
  val endsInCube  = Option.when(config.frame.gather)(Bool())
  val isScattered = Option.when(config.frame.gather)(Bool())

  /** The surface is of the environment. In direct view, the ray that it has gathered is complete: its light replaces the
    * ambient light, unless the path is straight. A path in direct view that ends elsewhere is that ray.
    */
  val isOfEnvironment = Option.when(config.gathersInRoom)(Bool())
}

/** A path that goes on after the light of its surface is added. */
final class ContinuedPath(config: PathConfig) extends Bundle {
  val context = Context(config)

  /** The ray that a point of the environment has gathered is complete: the point is lit. */
  val isBack = Option.when(config.gathersInRoom)(Bool())
}

/** The change of a path's throughput at a mirror or glass. */
final class BounceUpdate(config: PathConfig) extends Bundle {
  val context  = Context(config)
  val isFirst  = Bool()                // the first bounce of its path
  val albedo   = Rgb(FrameRegisters.colour)
  val isTinted = Bool()                // the path is tinted by the albedo
  val fresnel  = FrameRegisters.weight // the Fresnel term: the weight of the deferred reflection

  /** The reflection shows the remembered surface, lit by all lights, or the light cube; otherwise the background's colour. */
  val hasSurface = if (config.hasEnvironment) Some(Bool()) else None
  val showsCube  = if (config.gathersInRoom) Some(Bool()) else None
}

/** The colour of a path. */
final class PathColour(config: PathConfig) extends Bundle {
  val context = Context(config)
  val colour  = Rgb(FrameRegisters.colour)

  /** Of a directly visible surface of the environment: its shadow ratio. */
  val ratio = if (config.hasEnvironment) Some(Rgb(FrameRegisters.weight)) else None
}
