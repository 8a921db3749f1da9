package colonnade.environment

import chisel3._
import colonnade.common.Context
import colonnade.config.ColonnadeConfig

/** A context whose ray is to meet the room. */
final class RoomQuestion(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)

  /** It is the pixel's own ray. */
  val isSeen = Bool()

  /** It is beside the path. */
  val isAside = Bool()
}
