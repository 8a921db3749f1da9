package colonnade.formats

import chisel3._
import chisel3.util.log2Ceil
import colonnade.axi.Axi
import colonnade.config.{ArrayConfig, ColonnadeConfig, NumberFormats, SceneCacheConfig, UnitsConfig}
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

  /** Wide enough for the products of the largest frame. */
  val offset = SInt((HalfPlane.normalBits + coordinateBits + 1).W)
}

object HalfPlane {
  val normalBits: Int = 12
}

/** A record, not a bundle: Chisel reserves the name `width`. */
final class FrameSettings(numbers: NumberFormats) extends Record {

  /** Their register names are `width` and `height`. */
  val pixelsWide = UInt(numbers.coordinateBits.W)
  val pixelsHigh = UInt(numbers.coordinateBits.W)

  /** Only pixels in the rectangle and in all half-planes have primary rays that may hit the object. */
  val objectRect    = new PixelRect(numbers.coordinateBits)
  val objectOutline = Vec(FrameRegisters.outlineEdges, new HalfPlane(numbers.coordinateBits))

  /** Left shift of a position of camera or light to grid steps. */
  val unitShift = UInt(NumberFormats.bitLength(numbers.sceneBits).W)

  /** A frame in which no pixel leaves for this many cycles ends with an error; 0 disables the watchdog. Cycles in which
    * the pixel sink stalls do not count.
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
  * A record, not a bundle: Chisel reserves the name `direction`.
  */
final class Camera(numbers: NumberFormats) extends Record {
  private def vector = Vec3(SInt(numbers.macBits.W))

  val position = vector

  /** The direction to the frame's first pixel; its register name is `direction`. */
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

/** The column BVH memory. */
final class SceneMap(config: ColonnadeConfig) extends Bundle {

  /** Total number of records. */
  val recordCount = UInt(RecordFormats.idBits(config).W)

  /** The record of the root node. */
  val root = UInt(RecordFormats.addressBits(config).W)

  /** Instances that are on, from the first one; 0: the tree of `root` is in the axes of the world. */
  val instances = Option.when(config.frame.hasInstances)(UInt(NumberFormats.bitLength(config.frame.instances).W))

  /** Leaves have companions. */
  val hasColours = Option.when(config.geometry.cornerColours)(Bool())

  /** The distance of leaves, by a multiplication; 1 for the companion. */
  def leafRecords(count: UInt): UInt = hasColours.fold(count)(Mux(_, count << 1, count))
}

/** Where the records lie in DRAM. */
final class SceneInDram extends Bundle {

  /** The page of 4 KB in which the first line begins; docs/scene-cache.md. */
  val page = UInt(SceneInDram.pageBits.W)
}

/** The layout of records in DRAM: lines of two, at a pitch of a power of two, so that no line crosses a page of 4 KB.
  */
object SceneLines {
  val records: Int = SceneCacheConfig.lineRecords

  /** Bytes of a line; distance of consecutive lines in bytes. */
  def bytes(config: ColonnadeConfig): Int = records * new RecordFormats(config).recordBits / 8
  def pitch(config: ColonnadeConfig): Int =
    (1 << log2Ceil(bytes(config))).max(config.columnBvhMemory.cache.fold(0)(_.busBytes))
}

object SceneInDram {
  val addressBits: Int = Axi.addressBits
  val pageLog:     Int = 12
  val pageBits:    Int = addressBits - pageLog
}

/** Registers with the sections of a scene. */
trait SceneRegisters { def scene: SceneMap }

/** Registers that tell whether the device is busy. */
trait BusyRegisters { def status: Status }

/** The registers that the host writes before a frame. Constant while a frame runs. */
final class FrameRegisters(config: ColonnadeConfig) extends Bundle with SceneRegisters {
  private val numbers = config.numbers

  val frame       = new FrameSettings(numbers)
  val camera      = new Camera(numbers)
  val lights      = Vec(config.frame.lights, new Light(numbers))
  val ambient     = Rgb(FrameRegisters.intensity)
  val shading     = new Shading(config)
  val background  = Rgb(FrameRegisters.colour)
  val materials   = Vec(config.frame.materials, new Material(config))
  val bounds      = new Bounds(numbers)
  val scene       = new SceneMap(config)
  val environment = config.physicalAttributeMemory.map(_ => new EnvironmentView(numbers))
  val dram        = config.columnBvhMemory.cache.map(_ => new SceneInDram)
  val gather      = Gather(config)
  val instances   = Option.when(config.frame.hasInstances)(Vec(config.frame.instances, new ObjectInstance(config)))
}

object FrameRegisters {
  val outlineEdges: Int = 6 // the outline of a box has at most this many edges

  /** A light's intensity in one channel. */
  def intensity: Fixed = new Fixed(FixedPointFormat.unsigned(NumberFormats.lightBits, NumberFormats.lightFraction))

  /** A weight from 0 to 1: 2^fraction is 1; the weight 1. */
  def weight: Fixed = new Fixed(FixedPointFormat.unsigned(NumberFormats.lightFraction + 1, NumberFormats.lightFraction))
  def one: Fixed    = Fixed.literal(weight.format, BigInt(1) << NumberFormats.lightFraction)

  /** A linear colour channel; all ones is 1.0. */
  def colour: UInt = UInt(NumberFormats.colourBits.W)

  /** The elements of a record in the order of a bundle: the first is the most significant. */
  private[formats] def fields(named: (String, Data)*): SeqMap[String, Data] = SeqMap(named.reverse: _*)
}

final class Status extends Bundle {
  val busy = Bool()

  /** The frame is complete; cleared by the next start. */
  val done = Bool()
}

/** Sticky until the next start. A new one comes last. */
final class Errors(config: ColonnadeConfig) extends Bundle {
  val stackOverflow = Bool()
  val illegalRecord = Bool()
  val watchdog      = Bool()

  /** A read from DRAM failed; its records counted as 0. */
  val memory = config.columnBvhMemory.cache.map(_ => Bool())
}

/** Event counters of the last frame, summed over the array unless a field says otherwise. A new one comes last: the
  * others keep their addresses.
  */
final class Counters(config: ColonnadeConfig) extends Bundle {
  private def counter            = UInt(Counters.bits(config).W)
  private def environmentCounter = config.physicalAttributeMemory.map(_ => counter)
  private def cacheCounter       = config.columnBvhMemory.cache.map(_ => counter)

  /** Cycles from the start to the last pixel. */
  val cycles      = counter
  val raysPrimary = counter
  val raysShadow  = counter

  /** Traced rays, without rays that only meet the background. */
  val raysReflection = counter
  val raysRefraction = counter

  /** Rays of all kinds that enter the object's box. */
  val raysInBox     = counter
  val nodeReads     = counter
  val boxTests      = counter
  val triangleTests = counter

  /** Primary rays that hit the object. */
  val hits = counter

  /** Maximum number of entries of any stack. */
  val deepestStack = counter
  val recordReads  = counter

  /** Records that a context got from the read of another context. */
  val snoopHits     = counter
  val bankConflicts = counter

  /** Reads that a column's cache answers later, and lines that are read from DRAM. */
  val cacheMisses = cacheCounter
  val dramReads   = cacheCounter

  /** Cycles in which the bottleneck stage of a unit is busy, summed over units. */
  val busyRaySetup     = counter
  val busyBoxUnit      = counter
  val busyTriangleUnit = counter
  val busyShader       = counter

  /** Context cycles by state of the context; in the remaining cycles the context is in a later stage. */
  val idleContexts      = counter
  val contextsRaySetup  = counter
  val waitRecord        = counter
  val waitUnit          = counter
  val contextsBox       = counter
  val contextsTriangles = counter
  val contextsShading   = counter

  /** Environment march: rays; tiles and cells visited; cycles in which the march is busy, summed over units; context
    * cycles in which a context waits for the march or is in it.
    */
  val raysEnvironment     = environmentCounter
  val marchSteps          = environmentCounter
  val busyEnvironment     = environmentCounter
  val contextsEnvironment = environmentCounter

  /** Reads of the maps of the environment. */
  val albedoReads = environmentCounter
  val normalReads = environmentCounter
  val cellReads   = environmentCounter
  val planeReads  = environmentCounter

  /** Rays that diffuse surfaces gather. */
  val raysGather = Gather(config).map(_ => counter)
}

object Counters {

  /** Width of a counter: none overflows within 2^32^ cycles, whatever all parts of the array do in each of them. */
  def bits(config: ColonnadeConfig): Int = {
    val perColumn = config.array.rows * ArrayConfig.maxContexts + UnitsConfig.maxPathContexts
    48.max(32 + log2Ceil(config.array.columns * perColumn))
  }
}

/** The registers that the host reads. */
final class DeviceStatus(config: ColonnadeConfig) extends Bundle with BusyRegisters {
  val status   = new Status
  val errors   = new Errors(config)
  val counters = new Counters(config)
}

/** The registers that the host pulses. A new one comes last. */
final class Control(config: ColonnadeConfig) extends Bundle {

  /** A write of 1 starts a frame; makes the caches forget the scene. */
  val start      = Bool()
  val invalidate = config.columnBvhMemory.cache.map(_ => Bool())
}
