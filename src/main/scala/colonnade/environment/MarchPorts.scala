package colonnade.environment

import chisel3._
import chisel3.util.Decoupled
import colonnade.common.Context
import colonnade.config.{AttributeLayout, NumberFormats, PathConfig}
import colonnade.formats.{AlbedoEntry, EnvironmentView, PixelPosition, Vec3}
import colonnade.numbers.Fixed
import colonnade.ray.RayFormats

/** A ray that misses the object. Its direction is scaled: the largest component fills `f` bits. */
final class EnvironmentRay(config: PathConfig) extends Bundle {
  private val numbers = config.numbers

  val origin = Vec3(new Fixed(new RayFormats(numbers).scene)) // grid steps
  val dir    = Vec3(SInt((new MarchFormats(config.device).f + 1).W))
  val pixel  = new PixelPosition(config.device)               // the pixel of a ray from the camera
}

/** A ray to march. */
final class MarchRequest(config: PathConfig) extends Bundle {
  val context = Context(config)

  val ray          = new EnvironmentRay(config)
  val isFromCamera = Bool() // the ray comes from a camera, which may be anywhere: it sees the maps or misses
  val hitDistance = HitDistance(config) // the distance of the object on this ray; see `MarchResult.hidesObject`
}

/** The distance of the object's hit from the ray's origin along its dominant axis, in grid steps. */
object HitDistance {
  def apply(config: PathConfig): UInt = UInt((config.numbers.sceneBits + 1).W)
}

/** What of the environment a ray hits. */
object HitKind extends ChiselEnum {
  val miss, map, boundingPlane = Value
}

/** The point of the environment that a ray hits. Fields that do not belong to its kind are 0. */
final class MarchResult(config: PathConfig) extends Bundle {
  private val formats = new MarchFormats(config.device)
  private val layout  = AttributeLayout.of(config.device)

  val context = Context(config)
  val kind    = HitKind()

  /** `map`: the pixel with the point's albedo and normal. */
  val x = UInt(layout.xBits.W)
  val y = UInt(layout.yBits.W)

  val boundingPlane = UInt(layout.boundingPlaneIndexBits.W) // `boundingPlane`: the plane with albedo and normal
  val isHidden = Bool() // `map`: the point is on the extension of a surface, hidden by another one

  /** The point is at distance · 2^distanceExponent times the ray's direction. */
  val distance         = UInt((formats.f + 1).W)
  val distanceExponent = SInt(formats.shiftBits.W)

  val steps = UInt(formats.stepBits.W)                              // tiles and cells that the ray has passed
  val point = Vec3(new Fixed(new RayFormats(config.numbers).scene)) // grid steps, clamped to half the scene

  /** Of the maps; the normal is in the object's space. */
  val albedo = new AlbedoEntry
  val normal = Vec3(SInt(NumberFormats.normalBits.W))

  /** The point is of the map, visible to the camera, and nearer than the request's `hitDistance` by more than the
    * tolerance; and if the ray does not come from the camera, also farther than the tolerance from its origin.
    */
  val hidesObject = Bool()

  val isIllegal = Bool() // a response of the maps was illegal
}

/** Events of this cycle, for the counters. */
final class MarchEvents extends Bundle {
  val step    = Bool() // a tile or a cell is passed
  val busy    = Bool()
  val illegal = Bool() // a response to the current ray was illegal
}

final class EnvironmentMarchIO(config: PathConfig) extends Bundle {
  private val layout = AttributeLayout.of(config.device)

  val view    = Input(new EnvironmentView(config.numbers)) // constant while a ray is marched
  val request = Flipped(Decoupled(new MarchRequest(config)))
  val result  = Decoupled(new MarchResult(config))
  val maps    = new AttributePort(layout)                  // at most one request in flight in each channel
  val events  = Output(new MarchEvents)
}
