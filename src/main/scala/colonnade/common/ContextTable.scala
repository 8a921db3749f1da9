package colonnade.common

import chisel3._
import colonnade.config.ColonnadeConfig

/** Something that each context remembers, in a memory: one entry is read and one is written in a cycle.
  *
  * What is read comes in the next cycle, and for that cycle only. No context's entry is read in the cycle in which it is
  * written: which of both values a memory would show is its own affair.
  */
object ContextTable {
  def apply[T <: Data](config: ColonnadeConfig, entry: T): SyncReadMem[T] =
    SyncReadMem(config.array.contexts.max(2), entry)
}
