package colonnade.formats

import chisel3._
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.numbers.{Fixed, FixedPointFormat}

import scala.collection.immutable.SeqMap

/** A rectangle of pixels; `x1` and `y1` are exclusive. */
final class PixelRect(coordinateBits: Int) extends Bundle {
  val x0 = UInt(coordinateBits.W)
  val y0 = UInt(coordinateBits.W)
  val x1 = UInt(coordinateBits.W)
  val y1 = UInt(coordinateBits.W)
}

/** The pixels (px, py) with `x · px + y · py + offset ≥ 0`; all of them where every field is 0. */
final class HalfPlane(coordinateBits: Int) extends Bundle {
  val x = SInt(HalfPlane.normalBits.W)
  val y = SInt(HalfPlane.normalBits.W)

  /** As large as what it has to make up for in the largest frame. */
  val offset = SInt((HalfPlane.normalBits + coordinateBits + 1).W)
}

object HalfPlane {
  val normalBits: Int = 12
}

/** A record, not a bundle: Chisel keeps the name `width` for itself. */
final class FrameSettings(numbers: NumberFormats) extends Record {

  /** Called `width` and `height` outside. */
  val pixelsWide = UInt(numbers.coordinateBits.W)
  val pixelsHigh = UInt(numbers.coordinateBits.W)

  /** Only pixels in the rectangle and in all half-planes have rays that may meet the object. */
  val objectRect    = new PixelRect(numbers.coordinateBits)
  val objectOutline = Vec(FrameRegisters.outlineEdges, new HalfPlane(numbers.coordinateBits))

  /** A position of the camera or the light, shifted left by this, is in grid steps. */
  val unitShift = UInt(NumberFormats.bitLength(numbers.sceneBits).W)

  /** A frame in which no pixel leaves for so many cycles ends with an error; 0 waits for ever. Cycles in which the
    * pixel sink stalls do not count.
    */
  val watchdogCycles = UInt(32.W)

  val elements: SeqMap[String, Data] = FrameRegisters.fields(
    "width"          -> pixelsWide,
    "height"         -> pixelsHigh,
    "objectRect"     -> objectRect,
    "objectOutline"  -> objectOutline,
    "unitShift"      -> unitShift,
    "watchdogCycles" -> watchdogCycles
  )
}

/** The ray of pixel (x, y) has the direction `(direction << stepShift) + x · stepX + y · stepY`.
  *
  * A record, not a bundle: Chisel keeps the name `direction` for itself.
  */
final class Camera(numbers: NumberFormats) extends Record {
  private def vector = Vec3(SInt(numbers.macBits.W))

  val position = vector

  /** Towards the picture's first pixel; called `direction` outside. */
  val dir       = vector
  val stepX     = vector
  val stepY     = vector
  val stepShift = UInt(NumberFormats.bitLength(numbers.coordinateBits).W)

  val elements: SeqMap[String, Data] = FrameRegisters.fields(
    "position"  -> position,
    "direction" -> dir,
    "stepX"     -> stepX,
    "stepY"     -> stepY,
    "stepShift" -> stepShift
  )
}

/** The object's box: inclusive, in vertex units. */
final class Bounds(numbers: NumberFormats) extends Bundle {
  val low  = Vec3(UInt(numbers.vertexBits.W))
  val high = Vec3(UInt(numbers.vertexBits.W))
}

/** Where the sections of the column BVH memory lie: nodes, then triangles, then attributes. A base beyond the next one,
  * or beyond `recordCount`, counts as that.
  */
final class SceneMap(countBits: Int) extends Bundle {

  /** Records in all. */
  val recordCount     = UInt(countBits.W)
  val triangleBase    = UInt(countBits.W)
  val triangleRecords = UInt(countBits.W)
  val attributeBase   = UInt(countBits.W)
}

/** What the host writes before a frame. Constant while a frame runs.
  *
  * A record, not a bundle: without a physical-attribute memory there is no room.
  */
final class FrameRegisters(config: ColonnadeConfig) extends Record {
  private val numbers = config.numbers

  val frame      = new FrameSettings(numbers)
  val camera     = new Camera(numbers)
  val lights     = Vec(config.frame.lights, new Light(numbers))
  val ambient    = Rgb(FrameRegisters.intensity)
  val shading    = new Shading(config)
  val background = Rgb(FrameRegisters.colour)
  val materials  = Vec(config.frame.materials, new Material(config))
  val bounds     = new Bounds(numbers)
  val scene      = new SceneMap(RecordFormats.idBits(config))
  val room       = config.physicalAttributeMemory.map(_ => new RoomView(numbers))

  val elements: SeqMap[String, Data] = FrameRegisters.fields(
    Seq(
      "frame"      -> frame,
      "camera"     -> camera,
      "lights"     -> lights,
      "ambient"    -> ambient,
      "shading"    -> shading,
      "background" -> background,
      "materials"  -> materials,
      "bounds"     -> bounds,
      "scene"      -> scene
    ) ++ room.map("room" -> _): _*
  )
}

object FrameRegisters {

  /** A box seen from anywhere outside has no more edges. */
  val outlineEdges: Int = 6

  /** A light's intensity in one channel. */
  def intensity: Fixed = new Fixed(FixedPointFormat.unsigned(NumberFormats.lightBits, NumberFormats.lightFraction))

  /** A part of the whole: 2^fraction is all of it. */
  def share: Fixed = new Fixed(FixedPointFormat.unsigned(NumberFormats.lightFraction + 1, NumberFormats.lightFraction))

  /** All of it. */
  def whole: Fixed = Fixed.literal(share.format, BigInt(1) << NumberFormats.lightFraction)

  /** A linear colour channel; all ones is 1.0. */
  def colour: UInt = UInt(NumberFormats.colourBits.W)

  /** A record's elements, given as in a bundle: the first is the most significant. */
  private[formats] def fields(named: (String, Data)*): SeqMap[String, Data] = SeqMap(named.reverse: _*)
}

final class Status extends Bundle {
  val busy = Bool()

  /** The frame is complete; cleared by the next start. */
  val done = Bool()
}

/** Sticky until the next start. */
final class Errors extends Bundle {
  val stackOverflow = Bool()
  val illegalRecord = Bool()
  val watchdog      = Bool()
}

/** What happened in the last frame. Sums over the array, except where a field says otherwise. */
final class Counters(config: ColonnadeConfig) extends Bundle {
  private def counter     = UInt(Counters.bits.W)
  private def roomCounter = config.physicalAttributeMemory.map(_ => counter)

  /** From start to the last pixel. */
  val cycles      = counter
  val raysPrimary = counter
  val raysShadow  = counter

  /** Traced: not those that meet the background only. */
  val raysReflection = counter
  val raysRefraction = counter

  /** Rays of all kinds that entered the object's box. */
  val raysInBox     = counter
  val nodeReads     = counter
  val boxTests      = counter
  val triangleTests = counter

  /** Primary rays that hit the object. */
  val hits = counter

  /** Most entries that any stack held. */
  val deepestStack = counter
  val recordReads  = counter

  /** Records that a context took from a read of another one. */
  val snoopHits     = counter
  val bankConflicts = counter

  /** Unit cycles in which a unit's narrowest stage held work. */
  val busyRaySetup     = counter
  val busyBoxUnit      = counter
  val busyTriangleUnit = counter
  val busyShader       = counter

  /** Context cycles by where the context was; what is left of all context cycles, it was on its way out. */
  val idleContexts      = counter
  val contextsSetUp     = counter
  val waitRecord        = counter
  val waitUnit          = counter
  val contextsBox       = counter
  val contextsTriangles = counter
  val contextsShading   = counter

  /** Rays that looked for a point of the room, and the tiles and cells that they passed; unit cycles in which the march
    * was busy; context cycles in which a context waited for it, or its point was in work.
    */
  val raysRoom     = roomCounter
  val marchSteps   = roomCounter
  val busyRoom     = roomCounter
  val contextsRoom = roomCounter

  /** Questions that the maps of a room have answered. */
  val albedoReads = roomCounter
  val normalReads = roomCounter
  val cellReads   = roomCounter
  val planeReads  = roomCounter
}

object Counters {
  val bits: Int = 48
}

/** What the host reads. */
final class DeviceStatus(config: ColonnadeConfig) extends Bundle {
  val status   = new Status
  val errors   = new Errors
  val counters = new Counters(config)
}

final class Control extends Bundle {

  /** A write of 1 starts a frame. */
  val start = Bool()
}

/** What the host pulses. */
final class HostCommands extends Bundle {
  val control = new Control
}
