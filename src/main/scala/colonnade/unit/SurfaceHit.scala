package colonnade.unit

import chisel3._
import colonnade.common.Context
import colonnade.config.PathConfig
import colonnade.environment.HitDistance
import colonnade.formats.{InstanceNumber, RecordFormats}
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.RayFormats

/** The closest hit of a ray that is to be shaded. */
final class SurfaceHit(config: PathConfig) extends Bundle {
  val context   = Context(config)
  val isPrimary = Bool()
  val id        = UInt(RecordFormats.idBits(config.device).W) // packed triangle id
  val t         = new Fixed(new RayFormats(config.numbers).grid)

  val instance = InstanceNumber(config.device)

  /** From the ray's origin along its dominant axis. */
  val distance = Option.when(config.device.frame.hits || config.device.hasEnvironment)(HitDistance(config))
}

object SurfaceHit {

  /** The distance of a hit at `t` of a ray that enters the object's box at `tEntry`, in whole units. */
  def distance(config: PathConfig, tEntry: UInt, t: Fixed): UInt =
    Rounding.floor(tEntry, -config.numbers.gridFraction) +& t.integer.asUInt
}
