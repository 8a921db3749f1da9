package colonnade.unit

import chisel3._
import chisel3.util.Valid
import colonnade.common.First
import colonnade.config.PathConfig

/** Contexts that wait, a flag for each, in the order of their numbers: a context enters by any of some ports while it does
  * not wait. `next` comes two cycles later at the earliest, and stays until it is taken.
  */
private[unit] final class WaitingContexts(config: PathConfig) {
  private val waits   = RegInit(VecInit.fill(config.contexts)(false.B))
  private val isTaken = Wire(Bool())

  val next: Valid[UInt] = First.registered(waits, isTaken).now

  def enter(valid: Bool, context: UInt): Unit = {
    assert(!valid || !waits(context), "a context waits twice")
    when(valid) { waits(context) := true.B }
  }

  /** To be called once. */
  def take(isTaken: Bool): Unit = {
    this.isTaken := isTaken
    when(isTaken) { waits(next.bits) := false.B }
  }
}
