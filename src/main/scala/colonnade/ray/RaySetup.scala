package colonnade.ray

import chisel3._
import chisel3.util.Decoupled
import colonnade.config.{PathConfig, UnitsConfig}
import colonnade.formats.Bounds

final class RaySetupIO(config: PathConfig) extends Bundle {
  val request = Flipped(Decoupled(new RayRequest(config)))
  val bounds  = Input(new Bounds(config.numbers)) // constant while a ray is in the unit
  val ray     = Decoupled(new PreparedRay(config))

  /** The longest stage, [[RayEntry]], holds a ray; of a [[RaySetupPipeline]]: a ray enters. */
  val busy = Output(Bool())
}

/** Prepares rays for traversal: docs/numbers.md, section 2. In order. */
abstract class RaySetup(config: PathConfig) extends Module {
  final val io = IO(new RaySetupIO(config))
}

object RaySetup {

  /** The smallest unit that takes a ray every `units.rayInterval` cycles. */
  def apply(config: PathConfig): RaySetup =
    if (config.device.units.rayInterval >= UnitsConfig.sequentialRayInterval) new SequentialRaySetup(config)
    else new RaySetupPipeline(config)
}
