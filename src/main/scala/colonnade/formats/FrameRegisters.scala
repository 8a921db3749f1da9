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
  val towards   = vector
  val stepX     = vector
  val stepY     = vector
  val stepShift = UInt(NumberFormats.bitLength(numbers.coordinateBits).W)

  val elements: SeqMap[String, Data] = FrameRegisters.fields(
    "position"  -> position,
    "direction" -> towards,
    "stepX"     -> stepX,
    "stepY"     -> stepY,
    "stepShift" -> stepShift
  )
}

/** A point light. Its colour is its intensity where the squared distance is `reachMantissa · 2^reachExponent`, in grid
  * steps; it falls with the squared distance. With a mantissa of 0 it is the same everywhere.
  */
final class Light(numbers: NumberFormats) extends Bundle {
  val position      = Vec3(SInt(numbers.macBits.W))
  val colour        = Rgb(FrameRegisters.intensity)
  val reachMantissa = UInt(numbers.mantissaBits.W)
  val reachExponent = SInt((NumberFormats.bitLength(2 * numbers.sceneBits) + 1).W)
}

/** A record, not a bundle: without bounces some fields are not there. */
final class Shading(config: ColonnadeConfig) extends Record {
  private def ifBounces[T](field: => T): Option[T] = if (config.frame.hasBounces) Some(field) else None

  /** Shade with geometric normals, not with the vertices'. */
  val flat = Bool()

  /** Send shadow rays. */
  val shadows = Bool()

  /** Lights that shine: the first so many. */
  val lights = UInt(NumberFormats.bitLength(config.frame.lights).W)

  /** How far a secondary ray starts from the surface, in grid steps along the normal. */
  val offset = UInt((config.numbers.gridBits - 2).W)

  /** Reflections and refractions of a path that are traced; what comes then meets the background only. */
  val bounces = ifBounces(UInt(NumberFormats.bitLength(config.frame.maxBounces).W))

  /** What clear triangles let through of a light. */
  val clearness = ifBounces(FrameRegisters.share)

  val elements: SeqMap[String, Data] = FrameRegisters.fields(
    Seq("flat" -> flat, "shadows" -> shadows, "lights" -> lights, "offset" -> offset) ++
      bounces.map("bounces" -> _) ++ clearness.map("clearness" -> _): _*
  )
}

/** What becomes of a ray that meets a surface. */
object MaterialKind {
  val bits = 2

  /** Lambert's: it takes light from the lights. */
  def diffuse: UInt = 0.U(bits.W)

  def mirror: UInt = 1.U(bits.W)

  /** Refracts, and reflects Schlick's part. */
  def glass: UInt = 2.U(bits.W)
}

/** A record, not a bundle: without bounces all that there is of a material is its albedo. */
final class Material(config: ColonnadeConfig) extends Record {
  private def ifBounces[T](field: => T): Option[T] = if (config.frame.hasBounces) Some(field) else None
  private def eta = new Fixed(FixedPointFormat.unsigned(NumberFormats.etaBits, NumberFormats.etaFraction))

  val albedo = Rgb(FrameRegisters.colour)

  /** See [[MaterialKind]]. */
  val kind = ifBounces(UInt(MaterialKind.bits.W))

  /** Glass: the index of the side that the ray comes from over the other one's, for a ray that meets the front or the
    * back of a triangle.
    */
  val etaFront = ifBounces(eta)
  val etaBack  = ifBounces(eta)

  /** Glass: what it reflects head-on. */
  val reflectance = ifBounces(FrameRegisters.share)

  val elements: SeqMap[String, Data] = FrameRegisters.fields(
    Seq("albedo" -> albedo) ++ kind.map("kind" -> _) ++ etaFront.map("etaFront" -> _) ++ etaBack.map("etaBack" -> _) ++
      reflectance.map("reflectance" -> _): _*
  )
}

/** The object's box: inclusive, in vertex units. */
final class Bounds(numbers: NumberFormats) extends Bundle {
  val low  = Vec3(UInt(numbers.vertexBits.W))
  val high = Vec3(UInt(numbers.vertexBits.W))
}

/** Where the sections of the column BVH memory lie: nodes, then triangles, then attributes. */
final class SceneMap(countBits: Int) extends Bundle {

  /** Records in all. */
  val recordCount     = UInt(countBits.W)
  val triangleBase    = UInt(countBits.W)
  val triangleRecords = UInt(countBits.W)
  val attributeBase   = UInt(countBits.W)
}

/** Where the room is; docs/background.md.
  *
  * A position P in grid steps has the projection p = matrix · P + (offset << offsetShift), in steps of 2^-exponent. It is
  * seen at the map's pixel 1024 · (p.x, p.y) / p.z, and its w, the plane map's unit over its depth, is 1 / p.z.
  */
final class RoomView(numbers: NumberFormats) extends Bundle {
  val matrix      = Vec(3, Vec3(SInt(numbers.macBits.W)))
  val offset      = Vec3(SInt(numbers.macBits.W))
  val offsetShift = UInt(NumberFormats.bitLength(numbers.sceneBits).W)
  val exponent    = SInt((NumberFormats.bitLength(2 * numbers.sceneBits) + 1).W)

  /** Turns a normal of the maps, in view space, into object space. */
  val rotation = Vec(3, Vec3(new Fixed(FixedPointFormat.signed(RoomView.rotationBits, RoomView.rotationFraction))))

  /** Of the map's 1024 pixels, half a pixel of the frame: pixel (x, y)'s centre is at (2x + 1, 2y + 1) of these. */
  val stepX = UInt((numbers.shadeBits + RoomView.stepGuard).W)
  val stepY = UInt((numbers.shadeBits + RoomView.stepGuard).W)

  /** Entries of the shell. */
  val shellPlanes = UInt(8.W)

  /** Rays that meet nothing of the object meet the room; otherwise the background's colour. */
  val isThere = Bool()

  /** Pixels that show the room itself: only here. Elsewhere they have the background's colour and all the light. */
  val window = new PixelRect(numbers.coordinateBits)
}

object RoomView {
  val rotationBits:     Int = 16
  val rotationFraction: Int = 14

  /** Fraction bits of a step beyond those of a place in the map. */
  val stepGuard: Int = 12
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
