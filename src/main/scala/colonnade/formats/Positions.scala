package colonnade.formats

import chisel3._
import colonnade.config.ColonnadeConfig

/** A pixel to render. */
class PixelPosition(config: ColonnadeConfig) extends Bundle {
  val x = UInt(config.numbers.coordinateBits.W)
  val y = UInt(config.numbers.coordinateBits.W)
}

/** A pixel to render in a render unit. */
final class UnitPosition(config: ColonnadeConfig) extends PixelPosition(config) {

  /** Its primary ray may hit the object; always so without an environment. */
  val meetsObject = if (config.hasEnvironment) Some(Bool()) else None

  /** It is of a tile that may show the object, and not of one that only shows the environment. */
  val inObjectTile = if (config.hasEnvironment) Some(Bool()) else None
}
