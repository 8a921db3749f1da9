package colonnade.formats

import chisel3._
import colonnade.config.ColonnadeConfig

/** A pixel to render. */
class PixelPosition(config: ColonnadeConfig) extends Bundle {
  val x = UInt(config.numbers.coordinateBits.W)
  val y = UInt(config.numbers.coordinateBits.W)
}

/** A pixel to render in a path tracer. */
final class UnitPosition(config: ColonnadeConfig) extends PixelPosition(config) {

  /** With an environment: its primary ray may hit the object; it is of a tile that may show the object. */
  val meetsObject  = if (config.hasEnvironment) Some(Bool()) else None
  val inObjectTile = if (config.hasEnvironment) Some(Bool()) else None
}
