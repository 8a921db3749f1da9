package colonnade.formats

import chisel3._
import colonnade.config.{ColonnadeConfig, NumberFormats}

/** The maximum legal value of each register that can hold larger ones. The host reads back what it wrote; the device uses
  * the limit instead of larger values. Other registers may have any value; docs/errors.md.
  */
object RegisterLimits {

  /** By register name; all of them are unsigned. */
  def apply(config: ColonnadeConfig): Map[String, BigInt] = {
    val numbers   = config.numbers
    val one       = BigInt(1) << NumberFormats.lightFraction
    val materials = (0 until config.frame.materials).flatMap { index =>
      Seq(s"materials[$index].kind" -> MaterialKind.last(config), s"materials[$index].reflectance" -> one)
    }
    val limits = Seq(
      "frame.unitShift"             -> BigInt(numbers.maxUnitShift),
      "camera.stepShift"            -> BigInt(numbers.coordinateBits),
      "shading.lights"              -> BigInt(config.frame.lights),
      "shading.bounces"             -> BigInt(config.frame.maxBounces),
      "shading.shadowTransmittance" -> one,
      "gather.bounces"              -> BigInt(Gather.maxBounces),
      "scene.recordCount"           -> BigInt(config.columnBvhMemory.depth),
      "scene.instances"             -> BigInt(config.frame.instances)
    ) ++ materials
    val max = Layout.of(RegisterMap.settings(config)).map(field => field.name -> ((BigInt(1) << field.width) - 1)).toMap
    limits.filter { case (name, limit) => max.get(name).exists(limit < _) }.toMap
  }

  /** The value, clamped to the limit of its register. */
  def clamp(value: UInt, limit: Option[BigInt]): UInt =
    limit.fold(value)(max => Mux(value > max.U, max.U(value.getWidth.W), value))
}
