package colonnade.common

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.PartConfig

/** The number of a context: a path in a path unit, or a ray in a traversal unit. */
object Context {
  def apply(config: PartConfig): UInt = UInt(log2Ceil(config.contexts.max(2)).W)
}

/** A table with one entry per context, as a memory with one read port and one write port.
  *
  * The entry comes in the cycle after the read, and is valid in that cycle only. Read-during-write is undefined: no
  * entry is read in the cycle in which it is written.
  */
object ContextTable {
  def apply[T <: Data](config: PartConfig, entry: T): SyncReadMem[T] =
    SyncReadMem(config.contexts.max(2), entry)
}
