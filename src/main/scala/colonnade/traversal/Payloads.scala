package colonnade.traversal

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.ColonnadeConfig
import colonnade.formats.RecordFormats
import colonnade.numbers.Fixed
import colonnade.ray.{BoxRay, Context, RayFormats, TriangleRay}

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

/** One ray against the triangles of one record. */
final class TriangleCandidate(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val record  = new RecordFormats(config).triangles
  val ray     = new TriangleRay(config.numbers)
}

/** Where a ray meets a triangle. */
final class TriangleHit(config: ColonnadeConfig) extends Bundle {
  private val formats = new RayFormats(config.numbers)

  val t = new Fixed(formats.grid)

  /** Packed triangle id. */
  val id = UInt(RecordFormats.idBits(config).W)

  /** Barycentric weights of the vertices, up to a common factor. */
  val weights  = Vec(3, new Fixed(formats.weight))
  val backSide = Bool()
}

/** The outcome of one triangle; results come in the order of candidates, and of triangles in a record. */
final class TriangleResult(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)

  /** The ray meets the triangle at `hit.t` ≥ 0. */
  val isHit = Bool()
  val hit   = new TriangleHit(config)

  /** It lets some light through. */
  val isClear = Bool()

  /** The record's last triangle. */
  val isLast = Bool()
}
