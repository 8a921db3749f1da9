package colonnade.common

import chisel3._
import chisel3.util.{isPow2, log2Ceil, Decoupled, Valid}

/** Ports of [[ReservedQueue]]. */
final class ReservedQueueIO[T <: Data](item: T) extends Bundle {

  /** Only while the queue has space. */
  val in  = Flipped(Valid(item))
  val out = Decoupled(item)
}

/** A queue in a memory with one read port and one write port, for items that have their place reserved: it has no
  * back-pressure. An item is offered from the second cycle after it
  * came until it is taken.
  *
  * @param places a power of two
  */
final class ReservedQueue[T <: Data](item: T, places: Int) extends Module {
  require(isPow2(places) && places > 1, s"a queue of $places places; it must be a power of two from 2 on")

  val io = IO(new ReservedQueueIO(item))

  // Plain words: firtool replaces no memory of signed integers by a black box
  private val memory = SyncReadMem(places, UInt(item.getWidth.W))
  private val tail   = RegInit(0.U(log2Ceil(places).W))
  private val head   = RegInit(0.U(log2Ceil(places).W))
  private val count  = RegInit(0.U(log2Ceil(places + 1).W))
  when(io.in.valid) {
    memory.write(tail, io.in.bits.asUInt)
    tail := tail + 1.U
  }
  private val next = head + io.out.fire
  head         := next
  count        := count + io.in.valid - io.out.fire
  io.out.valid := RegNext(count =/= io.out.fire.asUInt, false.B)
  io.out.bits  := memory.read(next, count =/= 0.U).asTypeOf(item)
  assert(!io.in.valid || count < places.U, "an item without a place")
}
