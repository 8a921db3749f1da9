package colonnade.common

import chisel3._
import chisel3.util.{isPow2, log2Ceil, Decoupled, Valid}

final class ReservedQueueIO[T <: Data](item: T) extends Bundle {
  val in  = Flipped(Valid(item)) // only while the queue has space
  val out = Decoupled(item)

  /** `out` may be taken in the next cycle. Otherwise it is not offered then, and the memory is not read. */
  val mayTakeNext = Input(Bool())

  val validNext = Output(Bool()) // `out` is offered in the next cycle, if it may be taken
}

/** A queue in a memory with one read port and one write port, for items that have their place reserved: it has no
  * back-pressure. An item is offered from the second cycle after it came until it is taken, if it may be. Each cycle of an
  * offer takes a read.
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
