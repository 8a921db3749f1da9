package colonnade.shading

import chisel3._
import colonnade.common.Context
import colonnade.config.{ColonnadeConfig, NumberFormats}

/** A bounce or an end in [[ColourPipeline]]. */
final private[shading] class ColourOperation(config: ColonnadeConfig) extends Bundle {
  val context    = Context(config)
  val isBounce   = Bool()
  val hasSurface = Bool()
  val occlusions = Vec(config.frame.lights, Occlusion())
  val needsRatio = Bool()
}

/** A channel in the later stages of [[ColourPipeline]]. */
final private[shading] class ColourSlot(config: ColonnadeConfig) extends Bundle {
  private val bits = NumberFormats.colourBits

  /** The operation's last one; of its path, not of a reflected surface. */
  val isLast     = Bool()
  val isPath     = Bool()
  val isBounce   = Bool()
  val hasSurface = Bool()
  val needsRatio = Bool()
  val channel    = UInt(2.W)

  /** The path's radiance and throughput. */
  val radiance = UInt(bits.W)
  val weight   = UInt((NumberFormats.lightFraction + 1).W)
  val emission = Option.when(config.frame.emission)(UInt(bits.W))
}
