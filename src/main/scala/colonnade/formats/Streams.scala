package colonnade.formats

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.ColonnadeConfig
import colonnade.numbers.{Fixed, FixedPointFormat}

/** What a primary ray met, for tests and for the host's `--hits`. */
final class PixelHit(config: ColonnadeConfig) extends Bundle {

  /** Packed triangle id; only of pixels with `isObject`. */
  val triangle = UInt(RecordFormats.idBits(config).W)

  /** Distance from the camera along the ray's dominant axis, in the grid: entry and t together. */
  val distance = new Fixed(
    FixedPointFormat.unsigned(config.numbers.sceneBits + 1, config.numbers.gridFraction)
  )
}

/** A finished pixel as it leaves the device. */
final class Pixel(config: ColonnadeConfig) extends Bundle {
  val x = UInt(config.numbers.coordinateBits.W)
  val y = UInt(config.numbers.coordinateBits.W)

  /** Linear. */
  val colour   = Rgb(FrameRegisters.colour)
  val isObject = Bool()

  /** Of a pixel that shows the room: the part of the light that the object leaves to it; otherwise all. */
  val ratio = if (config.hasRoom) Some(Rgb(FrameRegisters.share)) else None
  val hit   = if (config.frame.hits) Some(new PixelHit(config)) else None
}

/** Which memories a [[Load]] is for. */
object LoadTarget {

  /** The first of the [[AttributeMemories]]. */
  val firstAttributes: Int = 1

  def bits(config: ColonnadeConfig): Int = log2Ceil(firstAttributes + AttributeMemories(config).size).max(2)

  def columnBvh(config: ColonnadeConfig): UInt = 0.U(bits(config).W)
}

/** A record on its way into the device's memories: into that of every column. */
final class Load(config: ColonnadeConfig) extends Bundle {
  private val formats = new RecordFormats(config)

  /** See [[LoadTarget]]; a load for no memory is dropped. */
  val target = UInt(LoadTarget.bits(config).W)

  /** As wide as the deepest memory needs. */
  val address = UInt((formats.addressBits +: AttributeMemories(config).map(m => log2Ceil(m.depth))).max.W)

  /** A word of another memory has the low bits. */
  val record = formats.record
}
