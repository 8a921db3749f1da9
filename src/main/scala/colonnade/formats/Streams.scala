package colonnade.formats

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.ColonnadeConfig
import colonnade.numbers.{Fixed, FixedPointFormat}

/** The hit of a primary ray, for tests and for the host's `--hits`. */
final class PixelHit(config: ColonnadeConfig) extends Bundle {

  /** Packed triangle id; valid if `isObject`. */
  val triangle = UInt(RecordFormats.idBits(config).W)

  /** Distance from the camera along the ray's dominant axis, in grid steps: the entry distance plus t. */
  val distance = new Fixed(FixedPointFormat.unsigned(config.numbers.sceneBits + 1, config.numbers.gridFraction))

  /** The object, where `scene.instances` are on. */
  val instance = InstanceNumber(config)
}

/** A finished pixel. */
final class Pixel(config: ColonnadeConfig) extends Bundle {
  val x        = UInt(config.numbers.coordinateBits.W)
  val y        = UInt(config.numbers.coordinateBits.W)
  val colour   = Rgb(FrameRegisters.colour) // a linear colour
  val isObject = Bool()

  /** The shadow ratio: of a pixel of the environment, its light with the object over that without; 1 for others. */
  val ratio = if (config.hasEnvironment) Some(Rgb(FrameRegisters.weight)) else None
  val hit   = if (config.frame.hits) Some(new PixelHit(config)) else None
}

/** The target memory of a [[Load]]. */
object LoadTarget {
  val firstAttributes: Int = 1 // the first of the [[AttributeMemories]]

  def bits(config: ColonnadeConfig): Int = log2Ceil(firstAttributes + AttributeMemories(config).size).max(2)

  def columnBvh(config: ColonnadeConfig): UInt = 0.U(bits(config).W)
}

/** A write to the device's memories: to the record memories of all columns, or to a memory of the environment's maps.
  */
final class Load(config: ColonnadeConfig) extends Bundle {
  private val formats = new RecordFormats(config)

  /** See [[LoadTarget]]; a load with an unknown target is dropped. */
  val target = UInt(LoadTarget.bits(config).W)

  /** Wide enough for the deepest memory. */
  val address = UInt((formats.addressBits +: AttributeMemories(config).map(m => log2Ceil(m.depth))).max.W)

  val record = formats.record // a word of another memory is in the low bits
}

/** A read request of a traversal unit or of the attribute fetch to its column. It may be withdrawn until it is
  * accepted.
  */
final class RecordRequest(config: ColonnadeConfig) extends Bundle {
  val address = UInt(RecordFormats.addressBits(config).W)
}

/** A record that a bank has read, broadcast to all requesters of the column for one cycle. */
final class RecordBroadcast(config: ColonnadeConfig) extends Bundle {
  val address = UInt(RecordFormats.addressBits(config).W)
  val record  = new RecordFormats(config).record
  val row     = UInt(log2Ceil(config.recordRequesters.max(2)).W) // the row that requested it

  /** With a cache: this is no record. The cache awaits it, and another broadcast will bring it. */
  val isLater = if (config.columnBvhMemory.cache.nonEmpty) Some(Bool()) else None
}

/** Reads of the maps that are accepted in one cycle; names as in `Counters`. */
final class AttributeEvents extends Bundle {
  val albedoReads = Bool()
  val normalReads = Bool()
  val cellReads   = Bool()
  val planeReads  = Bool()
}

/** A pixel to render. */
class PixelPosition(config: ColonnadeConfig) extends Bundle {
  val x = UInt(config.numbers.coordinateBits.W)
  val y = UInt(config.numbers.coordinateBits.W)
}

/** A pixel to render in a path tracer. */
final class UnitPosition(config: ColonnadeConfig) extends PixelPosition(config) {

  /** With an environment: its primary ray may hit the object; it is of a tile that may show the object. */
  val meetsObject  = if (config.hasEnvironment) Some(Bool()) else None
  val inObjectTile = if (config.hasEnvironment) Some(Bool()) else None
}

/** Three components, one per axis; `x` is the most significant. */
final class Vec3[T <: Data](private val component: T) extends Bundle {
  val x = component.cloneType
  val y = component.cloneType
  val z = component.cloneType

  def axes: Seq[T] = Seq(x, y, z)
}

object Vec3 {
  def apply[T <: Data](component: T): Vec3[T] = new Vec3(component)

  /** A wire with these components. */
  def of[T <: Data](components: Seq[T]): Vec3[T] = {
    val vector = Wire(new Vec3(chiselTypeOf(components.head)))
    vector.axes.zip(components).foreach { case (to, from) => to := from }
    vector
  }

  def of[T <: Data](x: T, y: T, z: T): Vec3[T] = of(Seq(x, y, z))
}

/** Red, green and blue; `r` is the most significant. */
final class Rgb[T <: Data](private val channel: T) extends Bundle {
  val r = channel.cloneType
  val g = channel.cloneType
  val b = channel.cloneType

  def channels: Seq[T] = Seq(r, g, b)
}

object Rgb {
  def apply[T <: Data](channel: T): Rgb[T] = new Rgb(channel)
}
