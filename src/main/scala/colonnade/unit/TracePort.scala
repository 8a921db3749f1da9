package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, Valid}
import colonnade.common.Context
import colonnade.config.PathConfig
import colonnade.environment.HitDistance
import colonnade.formats.{InstanceNumber, RecordFormats}
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.{PreparedRay, QueryBits, RayFormats, RayRequest}
import colonnade.shading.{Occlusion, ShadeRequest}
import colonnade.traversal.TriangleHit

/** From rays to hits with their attributes, seen from the unit that follows the paths. */
final class TracePort(config: PathConfig) extends Bundle {
  val rays = Decoupled(new PreparedRay(config))

  /** Rays in the axes of instances, to be prepared: they come back by `rays`. */
  val visits = Option.when(config.device.frame.hasInstances)(Flipped(Decoupled(new RayRequest(config))))

  val control = Flipped(new TraceControl(config))

  /** The hit of the ray that has a surface to shade, a cycle after it is resolved. After `control.readsDistance`, the
    * hit's distance comes in the same way.
    */
  val surfaceHit = Flipped(Valid(new SurfaceHit(config)))

  /** Hits to shade; they come only after a cycle with `hitsReadyNext`. */
  val hits          = Flipped(Decoupled(new ShadeRequest(config)))
  val hitsReadyNext = Output(Bool())

  /** A hit whose attributes have an illegal address. */
  val attributeError = Flipped(Valid(Context(config)))
}

/** What a ray has met, from a traversal unit. */
final class TraceResult(config: PathConfig) extends Bundle {
  val context = Context(config)
  val hasHit  = Bool()

  /** What a shadow ray has met; the hit of another ray, if `hasHit`. */
  val occlusion = Occlusion()
  val hit       = new TriangleHit(config)

  /** The hit triangle is not opaque. */
  val isClear = QueryBits(config)(Bool())

  val visit = Option.when(config.device.frame.hasInstances)(new VisitOutcome(config))
}

/** What a result tells of an instance; traversal units do not know it. */
final class VisitOutcome(config: PathConfig) extends Bundle {
  val instance = InstanceNumber(config.device).get

  /** The hit is the nearest one so far; the ray has met all that it meets. */
  val isNearer = Bool()
  val isLast   = Bool()
}

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
