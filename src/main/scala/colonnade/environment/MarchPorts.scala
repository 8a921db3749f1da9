package colonnade.environment

import chisel3._
import chisel3.util.Decoupled
import colonnade.common.Context
import colonnade.config.{AttributeLayout, NumberFormats, PathConfig}
import colonnade.formats.{AlbedoEntry, EnvironmentView, PixelPosition, Vec3}
import colonnade.numbers.Fixed
import colonnade.ray.RayFormats

/** A ray that misses the object. */
final class EnvironmentRay(config: PathConfig) extends Bundle {
  private val numbers = config.numbers

  /** Grid steps. */
  val origin = Vec3(new Fixed(new RayFormats(numbers).scene))

  /** Of any length. */
  val dir = Vec3(SInt(numbers.directionBits.W))

  /** The pixel of a ray from the camera. */
  val pixel = new PixelPosition(config)
}

/** A ray to march. */
final class MarchRequest(config: PathConfig) extends Bundle {
  val context = Context(config)

  val ray = new EnvironmentRay(config)

  /** The distance of the object on this ray; see [[MarchResult.hidesObject]]. */
  val hitDistance = HitDistance(config)
}

/** The distance of the object's hit from the ray's origin along its dominant axis, in grid steps. */
object HitDistance {
  def apply(config: PathConfig): UInt = UInt((config.numbers.sceneBits + 1).W)
}

/** Kinds of [[MarchResult]]. */
object HitKind {
  val bits: Int = 2

  val miss:          Int = 0
  val map:           Int = 1
  val boundingPlane: Int = 2
}

/** The point of the environment that a ray hits. Fields that do not belong to its kind are 0. */
final class MarchResult(config: PathConfig) extends Bundle {
  private val formats = new MarchFormats(config)
  private val layout  = AttributeLayout.of(config)

  val context = Context(config)

  /** See [[HitKind]]. */
  val kind = UInt(HitKind.bits.W)

  /** `map`: the pixel with the point's albedo and normal. */
  val x = UInt(layout.xBits.W)
  val y = UInt(layout.yBits.W)

  /** `boundingPlane`: the plane with the point's albedo and normal. */
  val boundingPlane = UInt(layout.boundingPlaneIndexBits.W)

  /** `map`: the point is on the extension of a surface, hidden by another one. */
  val isHidden = Bool()

  /** The point is at distance · 2^distanceExponent times the ray's direction. */
  val distance         = UInt((formats.f + 1).W)
  val distanceExponent = SInt(formats.shiftBits.W)

  /** Tiles and cells that the ray has passed. */
  val steps = UInt(formats.stepBits.W)

  /** Grid steps; each coordinate is clamped to half the scene's size. */
  val point = Vec3(new Fixed(new RayFormats(config.numbers).scene))

  /** Of the maps; the normal is in the object's space. */
  val albedo = new AlbedoEntry
  val normal = Vec3(SInt(NumberFormats.normalBits.W))

  /** The point is of the map, visible to the camera, and nearer than the request's `hitDistance` by more than the
    * tolerance; and if the ray does not come from the camera, also farther than the tolerance from its origin.
    */
  val hidesObject = Bool()

  /** A response of the maps was illegal. */
  val isIllegal = Bool()
}

/** Events of this cycle, for the counters. */
final class MarchEvents extends Bundle {

  /** A tile or a cell is passed. */
  val step = Bool()
  val busy = Bool()

  /** A response to the current ray was illegal. */
  val illegal = Bool()
}

/** Ports of [[EnvironmentMarch]]. */
final class EnvironmentMarchIO(config: PathConfig) extends Bundle {
  private val layout = AttributeLayout.of(config)

  /** Constant while a ray is marched. */
  val view    = Input(new EnvironmentView(config.numbers))
  val request = Flipped(Decoupled(new MarchRequest(config)))
  val result  = Decoupled(new MarchResult(config))

  /** At most one request in flight in each channel. */
  val maps   = new AttributePort(layout)
  val events = Output(new MarchEvents)
}
