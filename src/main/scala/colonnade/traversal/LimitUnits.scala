package colonnade.traversal

import chisel3._
import colonnade.config.NumberFormats
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.RayFormats

/** The largest `near` that may still hold something for a ray whose best t so far is `limit`: a grid distance, never
  * negative, in whole units, roundings and the boxes' padding included (docs/numbers.md, section 3). Combinational:
  * one add and a saturation.
  */
object LimitUnits {
  def apply(numbers: NumberFormats)(limit: Fixed): Fixed = {
    val formats = new RayFormats(numbers)
    require(limit.format == formats.grid, s"a limit in ${limit.format}; it must be in ${formats.grid}")
    val units = Rounding.floor(limit.integer, numbers.gridFraction)
    val slack = (BigInt(1) << numbers.boxPadLog) + 1
    Fixed(formats.units, Rounding.saturate(units +& slack.S, numbers.boxDistanceBits))
  }
}
