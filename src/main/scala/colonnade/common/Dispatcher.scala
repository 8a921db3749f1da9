package colonnade.common

import chisel3._
import chisel3.util.Decoupled

/** Ports of [[Dispatcher]]. */
final class DispatcherIO[T <: Data](private val item: T, count: Int) extends Bundle {
  val items = Flipped(Decoupled(item))

  /** Valid only where ready is set: a taker must not wait for an item before it is ready. */
  val takers = Vec(count, Decoupled(item))
}

/** Hands each item to one of the takers that are ready, in turn, so that consecutive items spread.
  *
  * Combinational; one item a cycle.
  */
final class Dispatcher[T <: Data](item: T, count: Int) extends Module {
  val io = IO(new DispatcherIO(item, count))

  private val turn = Module(new RoundRobin(count))
  turn.io.requests := VecInit(io.takers.map(_.ready)).asUInt
  turn.io.isTaken  := io.items.fire

  io.items.ready := turn.io.requests.orR
  io.takers.zip(turn.io.grant.asBools).foreach { case (taker, isGranted) =>
    taker.valid := io.items.valid && isGranted
    taker.bits  := io.items.bits
  }
}
