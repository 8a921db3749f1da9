package colonnade.common

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.PartConfig

/** The number of a context: a path in a path unit, or a ray in a traversal unit. */
object Context {
  def apply(config: PartConfig): UInt = UInt(log2Ceil(config.contexts.max(2)).W)
}
