package colonnade.traversal

import chisel3._
import colonnade.common.Context
import colonnade.config.PartConfig
import colonnade.formats.{LeafRecord, RecordFormats}
import colonnade.numbers.Fixed
import colonnade.ray.{RayFormats, TriangleRay}

/** One ray to test against the triangles of one record. */
final class TriangleCandidate(config: PartConfig) extends Bundle {
  val context = Context(config)
  val address = UInt(RecordFormats.addressBits(config.device).W)
  val record  = UInt(LeafRecord.recordBits(config.device.geometry).W)
  val ray     = new TriangleRay(config.numbers)

  /** The ray's mask leaves the record's triangles out. */
  val isMasked = Option.when(config.device.frame.rays)(Bool())
}

/** Where a ray intersects a triangle. */
sealed class HitPoint(config: PartConfig) extends Bundle {
  private val formats = new RayFormats(config.numbers)

  val t = new Fixed(formats.grid)

  /** Barycentric weights of the vertices, up to a common factor. */
  val weights  = Vec(3, new Fixed(formats.weight))
  val backSide = Bool()
}

/** The intersection of a ray with a triangle. */
final class TriangleHit(config: PartConfig) extends HitPoint(config) {
  val id = UInt(RecordFormats.idBits(config.device).W) // packed triangle id

  def point: HitPoint = {
    val point = Wire(new HitPoint(config))
    point.t        := t
    point.weights  := weights
    point.backSide := backSide
    point
  }
}

/** The result of one triangle. Results follow the order of candidates, and of triangles in a record. */
final class TriangleResult(config: PartConfig) extends Bundle {
  val context = Context(config)
  val isHit   = Bool() // the ray intersects the triangle at `hit.t` ≥ 0
  val hit     = new TriangleHit(config)

  /** The material transmits light; this is the last triangle of the record. */
  val isTransmissive = Bool()
  val isLast         = Bool()
}
