package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, Valid}
import colonnade.common.Context
import colonnade.config.{AttributeLayout, PathConfig}
import colonnade.formats.{AlbedoEntry, BoundingPlaneEntry, EnvironmentView, NormalEntry, PixelPosition, Vec3}
import colonnade.numbers.Fixed
import colonnade.ray.RayFormats
import colonnade.shading.EnvironmentSurface

/** A ray for a march, and what its path wants to know. */
final class MarchOrder(config: PathConfig) extends Bundle {
  val request     = new EnvironmentRequest(config)
  val ray         = new EnvironmentRay(config)
  val hitDistance = HitDistance(config) // for an occlusion test: the distance of its hit
}

/** What a ray has met. */
final class MarchAnswer(config: PathConfig) extends Bundle {
  val isHit           = Bool() // there is a point to shade; if the request was an occlusion test, it hides the hit
  val isOcclusionTest = Bool()
  val surface = new EnvironmentSurface(config) // the request's context; the point, if there is one
}

/** The path unit's port to the marches of its column. */
final class MarchPort(config: PathConfig) extends Bundle {

  /** For the pipeline of directly seen pixels; for the marches. At most one is accepted in a cycle. */
  val direct = Decoupled(new EnvironmentRequest(config))
  val march  = Decoupled(new EnvironmentRequest(config))

  val order = Output(new MarchOrder(config)) // the order, in the cycle after its request is accepted, and only then
  val answer = Flipped(Decoupled(new MarchAnswer(config))) // in any order

  /** Ties off a port without a requester. */
  def tieOff(): Unit = {
    for (req <- Seq(direct, march)) {
      req.valid := false.B
      req.bits  := DontCare
    }
    order        := DontCare
    answer.ready := true.B
  }
}

/** A ray that misses the object. Its direction is scaled: the largest component fills `f` bits. */
final class EnvironmentRay(config: PathConfig) extends Bundle {
  private val numbers = config.numbers

  val origin = Vec3(new Fixed(new RayFormats(numbers).scene)) // grid steps
  val dir    = Vec3(SInt((new MarchFormats(config.device).f + 1).W))
  val pixel  = new PixelPosition(config.device)               // the pixel of a ray from the camera
}

/** A ray to march. */
final class MarchRequest(config: PathConfig) extends Bundle {
  val ray          = new EnvironmentRay(config)
  val isFromCamera = Bool() // the ray comes from a camera, which may be anywhere: it sees the maps or misses
}

/** The distance of the object's hit from the ray's origin along its dominant axis, in grid steps. */
object HitDistance {
  def apply(config: PathConfig): UInt = UInt((config.numbers.sceneBits + 1).W)
}

/** What of the environment a ray hits. */
object HitKind extends ChiselEnum {
  val miss, map, boundingPlane = Value
}

/** The way of a ray to the frustum of the maps: mantissa · 2^exponent times its direction. */
final class MarchWay(formats: MarchFormats) extends Bundle {
  val mantissa = UInt((formats.f + 1).W)
  val exponent = SInt(formats.shiftBits.W)
}

/** What of the environment a ray hits. */
final class MarchHit(config: PathConfig) extends Bundle {
  private val formats = new MarchFormats(config.device)

  val kind  = HitKind()
  val pixel = new MapPixel(formats.layout) // `map`: the pixel with the point's albedo and normal
  val isHidden = Bool() // `map`: the point is on the extension of a surface, hidden by another one

  /** The point is at numerator / denominator · 2^(f + exponent) times the ray's direction; of a camera's ray behind
    * `way`.
    */
  val numerator, denominator = UInt(formats.f.W)
  val exponent               = SInt(formats.shiftBits.W)
  val way                    = new MarchWay(formats)
}

/** Albedo and normal of a point, as in the maps. */
final class BoundingTexel extends Bundle {
  val albedo = new AlbedoEntry
  val normal = new NormalEntry
}

/** Events of this cycle, for the counters. */
final class MarchEvents extends Bundle {
  val step    = Bool() // a tile or a cell is passed
  val busy    = Bool()
  val illegal = Bool() // a response of the maps is illegal
}

/** The maps that a march reads; at most one request in flight in each channel. */
final class MarchMaps(layout: AttributeLayout) extends Bundle {
  val cells  = new AttributeChannel(new CellRequest(layout), new CellResponse(layout), tagBits = 0)
  val planes = new AttributeChannel(new PlaneRequest(layout), new BoundingPlaneEntry, tagBits = 0)
}

final class EnvironmentMarchIO(config: PathConfig) extends Bundle {
  val view    = Input(new EnvironmentView(config.numbers)) // constant while a ray is marched
  val camera  = Flipped(Valid(new CameraOrigin(config)))   // the origin of all rays from the camera, once it is known
  val request = Flipped(Decoupled(new MarchRequest(config)))
  val hit     = Decoupled(new MarchHit(config))            // taken together with its request
  val texel   = Valid(new BoundingTexel)                   // after a hit of a bounding plane: its albedo and normal
  val maps    = new MarchMaps(AttributeLayout.of(config.device))
  val test    = Valid(new ClipTest(config))                // a ray from the camera is tested against a plane, 0 to 4
  val events  = Output(new MarchEvents)
}

/** A context whose ray is to be traced to the environment. */
final class EnvironmentRequest(config: PathConfig) extends Bundle {
  val context             = Context(config)
  val isDirectView        = Bool() // the ray is the pixel's primary ray
  val isFresnelReflection = Bool() // the ray is the deferred Fresnel reflection of a path
  val isOcclusionTest     = Bool() // the ray has hit the object: does the environment hide the hit?
}

/** Which requests are accepted in this cycle: rays from the camera, and others. So one kind does not wait for the
  * other.
  */
final class EnvironmentAccepts extends Bundle {
  val directView = Bool()
  val march      = Bool()
}
