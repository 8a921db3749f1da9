package colonnade.common

import chisel3._
import chisel3.util.{log2Ceil, RegEnable}

final class DelayLineIO[T <: Data](value: T) extends Bundle {
  val moves  = Input(Bool()) // the pipeline moves on by one stage
  val writes = Input(Bool()) // `in` is valid and must come out later
  val in     = Input(value)
  val reads  = Input(Bool()) // with this move the next value comes out
  val out    = Output(value)
}

/** Carries values along a pipeline that may stall, in a memory of `delay` words in place of shift registers.
  *
  * A value written with a move comes out `delay` moves later; it is `in` before the first of them. `out` stays until the
  * next move with `reads`: a register holds it, so that a stall costs no read of the memory. A word is never read in the
  * cycle in which it is written.
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
