package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, PriorityEncoder}
import colonnade.common.Choice
import colonnade.config.PathConfig
import colonnade.shading.Occlusion

/** What [[RtController]] knows of the shadow rays of each context. They follow the lights by their number.
  *
  * Nothing is reset: the results of lights that need no shadow ray are ignored.
  */
private[unit] final class ShadowProgress(config: PathConfig) {
  private val lights = config.device.frame.lights

  private val needs   = new FlagTable(config, UInt(lights.W))
  private val current = new FlagTable(config, UInt(log2Ceil(lights.max(2)).W))
  private val results = Seq.fill(lights)(new FlagTable(config, UInt(Occlusion.getWidth.W)))

  /** A surface is known, and the lights that it needs a shadow ray to. */
  def begin(valid: Bool, context: UInt, lights: UInt): Unit = needs.write(valid, context, lights)

  /** The light of the next shadow ray. */
  def next(choice: Choice, isFirst: Bool): UInt = {
    val needed = needs.read(choice)
    val after  = current.read(choice)
    PriorityEncoder(needed.asBools.zipWithIndex.map { case (needs, light) => needs && (isFirst || after < light.U) })
  }

  /** A shadow ray is traced. */
  def trace(valid: Bool, context: UInt, light: UInt): Unit = current.write(valid, context, light)

  /** A shadow ray has ended.
    *
    * @return whether lights are left
    */
  def end(valid: Bool, choice: Choice, occlusion: Occlusion.Type): Bool = {
    val needed = needs.read(choice)
    val light  = current.read(choice)
    for ((result, number) <- results.zipWithIndex)
      result.write(valid && light === number.U, choice.now.bits, occlusion.asUInt)
    VecInit(needed.asBools.zipWithIndex.map { case (needs, number) => needs && light < number.U }).asUInt.orR
  }

  /** The results, by light. */
  def occlusions(choice: Choice): Seq[Occlusion.Type] = {
    val needed = needs.read(choice)
    results.zipWithIndex.map { case (result, light) =>
      Mux(needed(light), Occlusion.safe(result.read(choice))._1, Occlusion.none)
    }
  }
}
