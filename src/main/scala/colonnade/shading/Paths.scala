package colonnade.shading

import chisel3._
import colonnade.common.Context
import colonnade.config.PathConfig
import colonnade.formats.{FrameRegisters, Rgb}

/** What a path shows where its ray ends. A Fresnel reflection shows one of the first three. */
object PathEnd extends ChiselEnum {

  /** No surface: the colour of the background, or light of the [[LightCube]]. */
  val background, cube = Value

  val lit        = Value // a surface in ambient light and lights
  val directView = Value // a surface of the environment that the camera sees: with its shadow ratio

  /** A point of the environment in direct view whose own ray has met the object. The path's radiance replaces the
    * ambient light.
    */
  val gathered = Value

  val gathers = Value // a surface without ambient light: the path goes on with a gathered ray

  /** Whether a device has such ends. */
  private[shading] def has(config: PathConfig, end: Type): Boolean =
    if (end == directView) config.device.hasEnvironment
    else if (end == gathered) config.device.gathersInRoom
    else config.device.frame.gather || (end != cube && end != gathers)

  /** Whether a path ends so. False in a device that has no such ends. */
  def is(config: PathConfig, path: Type, end: Type): Bool = if (has(config, end)) path === end else false.B
}

/** What the stages of [[ColourUnit]] ask of a [[PathEnd]]; none of it takes a register in a device without such ends.
  */
final private[shading] class ShownEnd extends Bundle {
  val hasSurface, isInCube, hasGathered, gathers = Bool()
}

private[shading] object ShownEnd {
  def apply(config: PathConfig, end: PathEnd.Type): ShownEnd = {
    val flags = Wire(new ShownEnd)
    flags.isInCube    := PathEnd.is(config, end, PathEnd.cube)
    flags.hasSurface  := !PathEnd.is(config, end, PathEnd.background) && !flags.isInCube
    flags.hasGathered := PathEnd.is(config, end, PathEnd.gathered)
    flags.gathers     := PathEnd.is(config, end, PathEnd.gathers)
    flags
  }
}

/** The end of a path's ray. */
final class PathTermination(config: PathConfig) extends Bundle {
  val context    = Context(config)
  val end        = PathEnd()
  val isStraight = Option.when(config.device.frame.hasBounces)(Bool()) // the path's throughput is 1, its radiance 0
  val occlusions = Vec(config.device.frame.lights, Occlusion())        // by light: the shadow rays' outcomes

  val isScattered = Bool() // the path has gathered: it sees no lights in the cube
  val goesBack    = Bool() // the ray is of a point of the environment, which is lit by the path's colour
}

/** A path that goes on after the light of its surface is added. */
final class ContinuedPath(config: PathConfig) extends Bundle {
  val context  = Context(config)
  val goesBack = Bool() // as in [[PathTermination]]: the colour is the path's radiance
}

/** The change of a path's throughput at a mirror or glass. */
final class BounceUpdate(config: PathConfig) extends Bundle {
  val context    = Context(config)
  val isFirst    = Bool()                // the first bounce of its path
  val albedo     = Rgb(FrameRegisters.colour)
  val isTinted   = Bool()                // the path is tinted by the albedo
  val fresnel    = FrameRegisters.weight // the Fresnel term: the weight of the deferred reflection
  val reflection = PathEnd()             // what it shows; a surface is lit by all lights
}

/** The colour of a path. */
final class PathColour(config: PathConfig) extends Bundle {
  val context = Context(config)
  val colour  = Rgb(FrameRegisters.colour)

  /** Of a directly visible surface of the environment: its shadow ratio. */
  val ratio = if (config.device.hasEnvironment) Some(Rgb(FrameRegisters.weight)) else None
}

/** The outcome of a shadow ray. */
object Occlusion extends ChiselEnum {
  val none         = Value // the ray hits nothing, or no ray was sent
  val transmissive = Value // the ray hits transmissive triangles only
  val opaque       = Value
}
