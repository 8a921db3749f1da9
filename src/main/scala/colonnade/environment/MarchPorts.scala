package colonnade.environment

import chisel3._
import chisel3.util.Decoupled
import colonnade.common.Context
import colonnade.config.{AttributeLayout, ColonnadeConfig, NumberFormats}
import colonnade.formats.{AlbedoEntry, PixelPosition, RoomView, Vec3}
import colonnade.numbers.Fixed
import colonnade.ray.RayFormats

/** A ray that meets nothing of the object. */
final class RoomRay(config: ColonnadeConfig) extends Bundle {
  private val numbers = config.numbers

  /** Grid steps. */
  val origin = Vec3(new Fixed(new RayFormats(numbers).scene))

  /** Of any length. */
  val towards = Vec3(SInt(numbers.directionBits.W))

  /** Of a ray from the camera: its pixel. */
  val pixel = new PixelPosition(config)
}

/** Which point of the room does a ray meet? */
final class MarchRequest(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)

  /** The ray comes from the camera: it meets what the maps show in its pixel. */
  val isSeen = Bool()
  val ray    = new RoomRay(config)
}

/** What a ray meets in the room. */
object RoomKind {
  val bits: Int = 2

  val nothing: Int = 0
  val map:     Int = 1
  val shell:   Int = 2
}

/** The point of the room that a ray meets. Fields that its kind does not name are 0. */
final class MarchResult(config: ColonnadeConfig) extends Bundle {
  private val formats = new MarchFormats(config)
  private val layout  = AttributeLayout.of(config)

  val context = Context(config)

  /** Of [[RoomKind]]. */
  val kind = UInt(RoomKind.bits.W)

  /** `map`: the pixel whose albedo and normal it has. */
  val x = UInt(layout.xBits.W)
  val y = UInt(layout.yBits.W)

  /** `shell`: the entry that has them. */
  val entry = UInt(layout.shellIndexBits.W)

  /** `map`: on the extension of a surface that something else hides. */
  val isHidden = Bool()

  /** The way there is travel · 2^travelExponent times the ray's direction. */
  val travel         = UInt((formats.f + 1).W)
  val travelExponent = SInt(formats.exponentBits.W)

  /** Tiles and cells that the ray has passed. */
  val steps = UInt(formats.stepBits.W)

  /** Grid steps, at most half as far as a scene reaches. */
  val point = Vec3(new Fixed(new RayFormats(config.numbers).scene))

  /** What the maps say of it; the normal in the object's space. */
  val albedo = new AlbedoEntry
  val normal = Vec3(SInt(NumberFormats.normalBits.W))

  /** An answer of the maps was. */
  val isIllegal = Bool()
}

/** For the counters, in this cycle. */
final class MarchEvents extends Bundle {

  /** A tile or a cell is passed. */
  val step = Bool()
  val busy = Bool()

  /** An answer to the ray of now was. */
  val illegal = Bool()
}

/** Ports of [[RoomMarch]]. */
final class RoomMarchIO(config: ColonnadeConfig) extends Bundle {
  private val layout = AttributeLayout.of(config)

  /** Constant while a ray marches. */
  val view    = Input(new RoomView(config.numbers))
  val request = Flipped(Decoupled(new MarchRequest(config)))
  val result  = Decoupled(new MarchResult(config))

  /** One question in flight in each channel at most; tags are 0. */
  val maps   = new AttributePort(layout, AttributePort.tagBits(config))
  val events = Output(new MarchEvents)
}
