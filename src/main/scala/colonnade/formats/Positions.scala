package colonnade.formats

import chisel3._
import colonnade.config.ColonnadeConfig

/** A pixel to render. */
class PixelPosition(config: ColonnadeConfig) extends Bundle {
  val x = UInt(config.numbers.coordinateBits.W)
  val y = UInt(config.numbers.coordinateBits.W)
}

/** A pixel for a render unit. */
final class UnitPosition(config: ColonnadeConfig) extends PixelPosition(config) {

  /** It may see the object; a unit without a room gets no others. */
  val meetsObject = if (config.hasRoom) Some(Bool()) else None
}
