package colonnade.formats

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.{ColonnadeConfig, NumberFormats}

/** An object with a transform of its own; docs/numbers.md, section 10. After a reset `scene.instances` is 0. */
final class ObjectInstance(config: ColonnadeConfig) extends Bundle with WithoutReset {

  /** `matrix` · 2^-shift leads from the grid of the world to the object's. */
  val matrix = Vec(3, Vec3(SInt(ObjectInstance.matrixBits.W)))
  val shift  = UInt(ObjectInstance.shiftBits.W)

  /** The world's position of the object's (0, 0, 0), in grid steps. */
  val origin = Vec3(SInt(config.numbers.gridBits.W))

  /** From a normal of the object to the world's, with [[ObjectInstance.normalFraction]] fraction bits. */
  val normal = Vec(3, Vec3(SInt(ObjectInstance.normalBits.W)))

  /** The record of the object's root node. */
  val root = UInt(RecordFormats.addressBits(config).W)

  /** Added to the materials of the object's faces. */
  val materialBase = UInt(RecordFormats.materialBits.W)

  val box = new ObjectBox
}

/** The object's box in the world: inclusive, in cells of 2^-[[ObjectBox.cellBits]] of the cube's edge. */
final class ObjectBox extends Bundle {
  val low  = Vec3(UInt(ObjectBox.cellBits.W))
  val high = Vec3(UInt(ObjectBox.cellBits.W))
}

object ObjectBox {
  val cellBits: Int = 7
}

object ObjectInstance {
  val matrixBits:     Int = 25
  val shiftBits:      Int = 6
  val normalFraction: Int = 14
  val normalBits:     Int = normalFraction + 2

  /** Low bits of a direction in the object's axes that a ray request has no place for. */
  def directionDrop(numbers: NumberFormats): Int = (matrixBits + numbers.gridBits - numbers.directionBits).max(0)
}

/** The number of an instance, in designs that have them. */
object InstanceNumber {
  def apply(config: ColonnadeConfig): Option[UInt] =
    Option.when(config.frame.hasInstances)(UInt(log2Ceil(config.frame.instances).W))
}
