package colonnade.shading

import chisel3._
import colonnade.common.Context
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.FrameRegisters

/** A bounce or an end in [[ColourUnit]]. */
final private[shading] class ColourOperation(config: PathConfig) extends Bundle {
  val context    = Context(config)
  val isBounce   = Bool()
  val isStraight = Bool()       // the path's throughput is 1, its radiance 0
  val end        = new ShownEnd // of the path, or of the Fresnel reflection
  val goesBack   = Bool()
  val occlusions = Vec(config.device.frame.lights, Occlusion())
  val needsRatio = Bool()

  /** What the path lets through at a bounce, and the weight of the Fresnel reflection. */
  val tint    = Option.when(config.device.frame.hasBounces)(Vec(3, FrameRegisters.weight))
  val fresnel = Option.when(config.device.frame.hasBounces)(FrameRegisters.weight)
}

/** What a slot of [[ColourUnit]] computes in a channel; the table of factors and terms is there. */
private[shading] object ColourPass extends ChiselEnum {
  val end        = Value // what a path shows where it ends, and its colour
  val reflection = Value // the surface that a Fresnel reflection shows
  val throughput = Value // the path's throughput after a bounce, or after a surface that gathers; its radiance
}

/** A channel of an operation, and a light of its surface, in the stages of [[ColourUnit]]. */
final private[shading] class ColourSlot(config: PathConfig) extends Bundle {
  val isValid    = Bool()
  val context    = Context(config)
  val pass       = ColourPass()
  val end        = new ShownEnd
  val goesBack   = Bool()
  val needsRatio = Bool()
  val isLast     = Bool() // the operation's last slot
  val channel    = UInt(2.W)

  /** The first light of the channel, the last one. */
  val isFirstLight = Bool()
  val isLastLight  = Bool()

  /** The path's radiance and throughput; the light that the surface adds. */
  val radiance = UInt(NumberFormats.colourBits.W)
  val weight   = UInt((NumberFormats.lightFraction + 1).W)
  val emission = Option.when(config.device.frame.emission)(UInt(NumberFormats.colourBits.W))

  def isIn(pass: ColourPass.Type): Bool = this.pass === pass
}
