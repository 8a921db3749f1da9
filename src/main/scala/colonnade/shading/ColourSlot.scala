package colonnade.shading

import chisel3._
import chisel3.util.Valid
import colonnade.common.Context
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.FrameRegisters

/** A bounce or an end in [[ColourUnit]]. */
final private[shading] class ColourOperation(config: PathConfig) extends Bundle {
  val context    = Context(config)
  val isBounce   = Bool()
  val isStraight = Bool()
  val hasSurface = Bool()
  val occlusions = Vec(config.frame.lights, Occlusion())
  val needsRatio = Bool()

  /** Of a bounce: what the path lets through, and the weight of the Fresnel reflection. */
  val tint    = Option.when(config.frame.hasBounces)(Vec(3, FrameRegisters.weight))
  val fresnel = Option.when(config.frame.hasBounces)(FrameRegisters.weight)

  /** Of an end: the path goes on with a gathered ray. */
  val gathers = Option.when(config.frame.gather)(Bool())

  /** The path ends in the light cube, or the Fresnel reflection does. */
  val showsCube = Option.when(config.frame.gather)(Bool())

  /** Of an end: its colour is what a point of the environment has gathered; that replaces the point's ambient light. */
  val goesBack    = Option.when(config.gathersInRoom)(Bool())
  val hasGathered = Option.when(config.gathersInRoom)(Bool())
}

/** A channel and a light of an operation in the stages of [[ColourUnit]]. */
final private[shading] class ColourSlot(config: PathConfig) extends Bundle {
  private val bits = NumberFormats.colourBits

  val context = Context(config)
  val isValid = Bool()

  /** The operation's last one; of its path, not of a reflected surface. */
  val isLast     = Bool()
  val isPath     = Bool()
  val isBounce   = Bool()
  val hasSurface = Bool()
  val needsRatio = Bool()
  val channel    = UInt(2.W)

  /** The first light of the channel, the last one. */
  val isFirstLight = Bool()
  val isLastLight  = Bool()

  /** The path's radiance and throughput. */
  val radiance = UInt(bits.W)
  val weight   = UInt((NumberFormats.lightFraction + 1).W)
  val emission = Option.when(config.frame.emission)(UInt(bits.W))

  /** The path gathers; the light of the cube where the ray ends there, from the second stage on. */
  val gathers = Option.when(config.frame.gather)(Bool())
  val cube    = Option.when(config.frame.gather)(Valid(UInt(NumberFormats.lightBits.W)))

  val goesBack    = Option.when(config.gathersInRoom)(Bool())
  val hasGathered = Option.when(config.gathersInRoom)(Bool()) // the radiance is that light
}
