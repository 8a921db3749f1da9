package colonnade.traversal

import chisel3._
import chisel3.util.log2Ceil
import colonnade.common.Context
import colonnade.config.TraversalConfig
import colonnade.formats.{NodeRecord, RecordFormats}
import colonnade.numbers.Fixed
import colonnade.ray.{BoxRay, RayFormats}

/** The record of a node or of a leaf's triangles. */
final class NodeRef(config: TraversalConfig) extends Bundle {
  val isLeaf  = Bool()
  val address = UInt(RecordFormats.addressBits(config.device).W)
}

/** A child whose box a ray enters, and the entry distance in units. */
final class EnteredChild(config: TraversalConfig) extends Bundle {
  val target = new NodeRef(config)
  val tNear  = new Fixed(new RayFormats(config.numbers).units)
}

/** One ray to test against one node; `tMax` is the largest entry distance that may still hold a hit, see [[TMaxUnits]]. */
final class BoxCandidate(config: TraversalConfig) extends Bundle {
  val context = Context(config)
  val node    = new RecordFormats(config.device).node
  val ray     = new BoxRay(config.numbers)
  val tMax    = new Fixed(new RayFormats(config.numbers).units)
}

/** The children that the ray enters: the first `count` of `children`, sorted by entry distance. */
final class BoxResult(config: TraversalConfig) extends Bundle {
  val context  = Context(config)
  val count    = UInt(log2Ceil(NodeRecord.most + 1).W)
  val children = Vec(NodeRecord.most, new EnteredChild(config))

  /** Children tested, without empty ones. */
  val tests = UInt(log2Ceil(NodeRecord.most + 1).W)
}
