package colonnade.traversal

import chisel3._
import colonnade.common.Context
import colonnade.config.{NumberFormats, TraversalConfig}
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.RayFormats

/** Reads the largest entry distance of a box that may hold a closer hit, of the ray of a context: in the same cycle. */
final class TMaxReader(config: TraversalConfig) extends Bundle {
  val context = Output(Context(config))
  val units   = Input(new Fixed(new RayFormats(config.numbers).units))
}

/** Converts a ray's largest t from grid steps to whole units: the largest `tNear` of a box that may still hold a hit.
  *
  * The result includes rounding errors and the padding of boxes (docs/numbers.md, section 3). `tMax` is never negative.
  * Combinational: one addition and a saturation.
  */
object TMaxUnits {
  def apply(numbers: NumberFormats)(tMax: Fixed): Fixed = {
    val formats = new RayFormats(numbers)
    require(tMax.format == formats.grid, s"tMax is in ${tMax.format}; it must be in ${formats.grid}")
    val units = Rounding.floor(tMax.integer, numbers.gridFraction)
    val slack = (BigInt(1) << numbers.boxPadLog) + 1
    Fixed(formats.units, Rounding.saturate(units +& slack.S, numbers.boxDistanceBits))
  }
}
