package colonnade.common

import chisel3._
import chisel3.util.{DecoupledIO, Pipe, Queue, RegEnable, Valid}
import colonnade.config.ColonnadeConfig

/** Registers that cut a long path: what passes comes a cycle later.
  *
  * A slice that costs no throughput is always there: `TimingSlice(signal)`. In the traversal loop and in the caches a cycle
  * more costs rays per cycle. There a slice exists with `units.extraSlices` only: `TimingSlice.extra(config)` makes it, or
  * what passes everything on as it is.
  */
sealed class TimingSlice private[common] (val isEnabled: Boolean) {
  val cycles: Int = if (isEnabled) 1 else 0 // latency

  def apply[T <: Data](signal: T): T = apply(signal, true.B)

  /** Holds while it is not enabled. */
  def apply[T <: Data](signal: T, enable: Bool): T = if (isEnabled) RegEnable(signal, enable) else signal

  /** Defined from the reset on. */
  def flag(signal: Bool, atReset: Boolean = false): Bool = if (isEnabled) RegNext(signal, atReset.B) else signal

  def valid[T <: Data](signal: Valid[T]): Valid[T] = if (isEnabled) Pipe(signal.valid, signal.bits) else signal

  /** A queue of two, for one transfer per cycle; `ready` is also registered. */
  def queue[T <: Data](stream: DecoupledIO[T]): DecoupledIO[T] = if (isEnabled) Queue(stream, 2) else stream
}

object TimingSlice extends TimingSlice(isEnabled = true) {

  /** A slice that is there with `units.extraSlices`. */
  def extra(config: ColonnadeConfig): TimingSlice = new TimingSlice(config.units.extraSlices)
}
