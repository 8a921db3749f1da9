package colonnade.shading

import chisel3._
import colonnade.common.Context
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameRegisters, Rgb}

/** A path that meets its last surface. */
final class PathEnd(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)

  /** It meets no surface of the object: the background's colour counts. */
  val isBackground = Bool()

  /** By light: what the shadow rays have met. */
  val occlusions = Vec(config.frame.lights, Occlusion())

  /** The surface is the room's, seen directly: what part of the light is left counts as well. */
  val isSeen = if (config.hasRoom) Some(Bool()) else None
}

/** What a mirror or glass does to a path. */
final class PathTurn(config: ColonnadeConfig) extends Bundle {
  val context  = Context(config)
  val albedo   = Rgb(FrameRegisters.colour)
  val isTinted = Bool()

  /** The share of what lies behind, by Schlick's reflection. */
  val share = FrameRegisters.share

  /** That is the remembered surface, in all its light; otherwise the background's colour. */
  val hasSurface = if (config.hasRoom) Some(Bool()) else None
}

/** The colour of a path. */
final class PathColour(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val colour  = Rgb(FrameRegisters.colour)

  /** Of a surface that is seen: the light left. */
  val ratio = if (config.hasRoom) Some(Rgb(FrameRegisters.share)) else None
}
