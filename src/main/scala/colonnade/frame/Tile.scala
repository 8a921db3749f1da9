package colonnade.frame

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.ColonnadeConfig

/** The first pixel of a square of `frame.tileSize`; both are multiples of it. */
final class Tile(config: ColonnadeConfig) extends Bundle {
  val x = UInt(config.numbers.coordinateBits.W)
  val y = UInt(config.numbers.coordinateBits.W)
}

object Tile {

  /** Levels of the Morton code of a pixel in its tile. */
  def pixelLevels(config: ColonnadeConfig): Int = log2Ceil(config.frame.tileSize)

  /** Levels of the Morton code of a tile, for any frame that the registers can hold. */
  def tileLevels(config: ColonnadeConfig): Int = (config.numbers.coordinateBits - pixelLevels(config)).max(1)
}
