package colonnade.common

import chisel3._
import chisel3.util.{isPow2, log2Ceil, Decoupled, DecoupledIO, Pipe, Queue, RegEnable, Valid}
import colonnade.config.ColonnadeConfig

/** Registers that cut a long path: what passes comes a cycle later.
  *
  * A slice that costs no throughput is always there: `TimingSlice(signal)`. In the traversal loop and in the caches a
  * cycle more costs rays per cycle. There a slice exists with `units.extraSlices` only: `TimingSlice.extra(config)`
  * makes it, or what passes everything on as it is.
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

final class DelayLineIO[T <: Data](value: T) extends Bundle {
  val moves  = Input(Bool()) // the pipeline moves on by one stage
  val writes = Input(Bool()) // `in` is valid and must come out later
  val in     = Input(value)
  val reads  = Input(Bool()) // with this move the next value comes out
  val out    = Output(value)
}

/** Carries values along a pipeline that may stall, in a memory of `delay` words in place of shift registers.
  *
  * A value written with a move comes out `delay` moves later; it is `in` before the first of them. `out` stays until
  * the next move with `reads`: a register holds it, so that a stall costs no read of the memory. A word is never read
  * in the cycle in which it is written.
  *
  * @param isSteady false: `out` is valid for one cycle
  */
final class DelayLine[T <: Data](value: T, delay: Int, isSteady: Boolean = true) extends Module {
  require(delay >= 2, s"a delay line of $delay moves; it must have at least 2")

  val io = IO(new DelayLineIO(value))

  // The word that is written now was written before by the value that is out now
  private val memory  = SyncReadMem(delay, value)
  private val current = RegInit(0.U(log2Ceil(delay).W))
  private val next    = Mux(current === (delay - 1).U, 0.U, current + 1.U)

  when(io.moves) { current := next }
  when(io.moves && io.writes) { memory.write(current, io.in) }

  private val reads  = io.moves && io.reads
  private val isRead = RegNext(reads, false.B)
  private val out    = memory.read(next, reads)
  io.out := (if (isSteady) Mux(isRead, out, RegEnable(out, isRead)) else out)
}

final class ReservedQueueIO[T <: Data](item: T) extends Bundle {
  val in  = Flipped(Valid(item)) // only while the queue has space
  val out = Decoupled(item)

  /** `out` may be taken in the next cycle. Otherwise it is not offered then, and the memory is not read. */
  val mayTakeNext = Input(Bool())

  val validNext = Output(Bool()) // `out` is offered in the next cycle, if it may be taken
}

/** A queue in a memory with one read port and one write port, for items that have their place reserved: it has no
  * back-pressure. An item is offered from the second cycle after it came until it is taken, if it may be. Each cycle of
  * an offer takes a read.
  */
final class ReservedQueue[T <: Data](item: T, places: Int) extends Module {
  require(places > 1, s"a queue of $places places; it must have two at least")

  val io = IO(new ReservedQueueIO(item))

  // Plain words: firtool replaces no memory of signed integers by a black box
  private val memory = SyncReadMem(places, UInt(item.getWidth.W))
  private val tail   = RegInit(0.U(log2Ceil(places).W))
  private val head   = RegInit(0.U(log2Ceil(places).W))
  private val count  = RegInit(0.U(log2Ceil(places + 1).W))
  when(io.in.valid) {
    memory.write(tail, io.in.bits.asUInt)
    tail := after(tail)
  }
  private val next  = Mux(io.out.fire, after(head), head)
  private val reads = io.validNext && io.mayTakeNext
  head         := next
  count        := count + io.in.valid - io.out.fire
  io.validNext := count =/= io.out.fire.asUInt
  io.out.valid := RegNext(reads, false.B)
  io.out.bits  := memory.read(next, reads).asTypeOf(item)
  assert(!io.in.valid || count < places.U, "an item without a place")

  private def after(place: UInt): UInt =
    if (isPow2(places)) place + 1.U else Mux(place === (places - 1).U, 0.U, place + 1.U)
}
