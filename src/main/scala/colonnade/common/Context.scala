package colonnade.common

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.ColonnadeConfig

/** Names a ray in flight in its render unit. */
object Context {
  def apply(config: ColonnadeConfig): UInt = UInt(log2Ceil(config.array.contexts.max(2)).W)
}
