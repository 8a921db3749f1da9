package colonnade.traversal

import chisel3._
import chisel3.util.log2Ceil
import colonnade.common.Context
import colonnade.config.ColonnadeConfig
import colonnade.formats.RecordFormats
import colonnade.numbers.Fixed
import colonnade.ray.{BoxRay, RayFormats}

/** A record that a ray has still to look at. */
final class Visit(config: ColonnadeConfig) extends Bundle {
  val isLeaf  = Bool()
  val address = UInt(RecordFormats.addressBits(config).W)
}

/** A child that a ray enters, with the distance at which it does, in units. */
final class EnteredChild(config: ColonnadeConfig) extends Bundle {
  val visit = new Visit(config)
  val near  = new Fixed(new RayFormats(config.numbers).units)
}

/** One ray against one node.
  *
  * @note `limit`: the largest near that may still hold something, see [[LimitUnits]].
  */
final class BoxCandidate(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val node    = new RecordFormats(config).node
  val ray     = new BoxRay(config.numbers)
  val limit   = new Fixed(new RayFormats(config.numbers).units)
}

/** The children entered: the first `count` of `children`, near to far. */
final class BoxResult(config: ColonnadeConfig) extends Bundle {
  val context  = Context(config)
  val count    = UInt(log2Ceil(config.geometry.arity + 1).W)
  val children = Vec(config.geometry.arity, new EnteredChild(config))

  /** Children that were not empty. */
  val tests = UInt(log2Ceil(config.geometry.arity + 1).W)
}
