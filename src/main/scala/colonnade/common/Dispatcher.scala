package colonnade.common

import chisel3._
import chisel3.util.Decoupled

final class DispatcherIO[T <: Data](private val item: T, count: Int) extends Bundle {
  val items  = Flipped(Decoupled(item))
  val takers = Vec(count, Decoupled(item)) // valid only where ready is set: ready must not depend on valid
}

/** Dispatches each item to one of the ready takers in round-robin order, so that consecutive items spread.
  *
  * Combinational; throughput one item per cycle.
  */
final class Dispatcher[T <: Data](item: T, count: Int) extends Module {
  val io = IO(new DispatcherIO(item, count))

  private val arbiter = Module(new RoundRobin(count))
  arbiter.io.requests := VecInit(io.takers.map(_.ready)).asUInt
  arbiter.io.isTaken  := io.items.fire

  io.items.ready := arbiter.io.requests.orR
  io.takers.zip(arbiter.io.grant.asBools).foreach { case (taker, isGranted) =>
    taker.valid := io.items.valid && isGranted
    taker.bits  := io.items.bits
  }
}
