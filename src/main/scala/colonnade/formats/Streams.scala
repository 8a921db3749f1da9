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

/** A write to the device's memories: to the record memories of all columns, or to a memory of the environment's maps. */
final class Load(config: ColonnadeConfig) extends Bundle {
  private val formats = new RecordFormats(config)

  /** See [[LoadTarget]]; a load with an unknown target is dropped. */
  val target = UInt(LoadTarget.bits(config).W)

  /** Wide enough for the deepest memory. */
  val address = UInt((formats.addressBits +: AttributeMemories(config).map(m => log2Ceil(m.depth))).max.W)

  val record = formats.record // a word of another memory is in the low bits
}
