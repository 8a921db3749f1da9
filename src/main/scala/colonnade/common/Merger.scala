package colonnade.common

import chisel3._
import chisel3.util.{Decoupled, Mux1H}

final class MergerIO[T <: Data](private val item: T, count: Int) extends Bundle {
  val givers = Flipped(Vec(count, Decoupled(item))) // ready depends on valid
  val items  = Decoupled(item)
}

/** Merges streams in round-robin order: a stream that stays valid gives one of the next `count` items.
  *
  * Combinational; throughput one item per cycle. Unlike Chisel's `RRArbiter`, it has a reset.
  */
final class Merger[T <: Data](item: T, count: Int) extends Module {
  val io = IO(new MergerIO(item, count))

  private val arbiter = Module(new RoundRobin(count)).io
  arbiter.requests := VecInit(io.givers.map(_.valid)).asUInt
  arbiter.isTaken  := io.items.fire

  io.items.valid := arbiter.requests.orR
  io.items.bits  := Mux1H(arbiter.grant, io.givers.map(_.bits))
  io.givers.zip(arbiter.grant.asBools).foreach { case (giver, isGranted) => giver.ready := isGranted && io.items.ready }
}
