package colonnade.column

import chisel3._
import chisel3.util.{Decoupled, RegEnable, Valid}
import colonnade.common.RoundRobin
import colonnade.config.{ColonnadeConfig, PathConfig}
import colonnade.ray.PreparedRay

final class RayBusIO(config: ColonnadeConfig) extends Bundle {
  val rays = Flipped(Decoupled(new PreparedRay(PathConfig(config))))

  /** By row: the unit has an idle context, without regard to a ray that comes in this cycle. */
  val isFree = Input(Vec(config.array.rows, Bool()))
  val units  = Vec(config.array.rows, Valid(new PreparedRay(PathConfig(config))))
}

/** Sends each ray to a traversal unit with an idle context, by round-robin, so that rays spread evenly.
  *
  * Throughput: a ray a cycle, to one unit every other cycle. Latency: one cycle. The unit that receives a ray is not
  * chosen for the next one in the same cycle, because `isFree` does not count that ray yet. So a ray on the bus is never
  * refused.
  */
final class RayBus(config: ColonnadeConfig) extends Module {
  val io = IO(new RayBusIO(config))

  private val rows    = config.array.rows
  private val targets = RegInit(0.U(rows.W))
  private val arbiter = Module(new RoundRobin(rows)).io
  private val ray     = RegEnable(io.rays.bits, io.rays.fire)
  arbiter.requests := io.isFree.asUInt & ~targets
  arbiter.isTaken  := io.rays.fire
  io.rays.ready    := arbiter.requests.orR
  targets          := Mux(io.rays.fire, arbiter.grant, 0.U)
  io.units.zip(targets.asBools).foreach { case (unit, isTarget) =>
    unit.valid := isTarget
    unit.bits  := ray
  }
}
