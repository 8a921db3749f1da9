package colonnade.shading

import chisel3._
import chisel3.util.{Decoupled, Mux1H, RegEnable}
import colonnade.common.{Dispatcher, RoundRobin}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameRegisters, Rgb}
import colonnade.numbers.Fixed
import colonnade.ray.RayFormats

/** A hit on a mirror or glass, and what the path has to know of its surface. */
final class BounceJob(config: ColonnadeConfig) extends Bundle {
  val request = new BounceRequest(config)
  val albedo  = Rgb(FrameRegisters.colour)

  /** See [[BouncedRay]]. */
  val isTinted = Bool()
}

/** Ports of [[BouncePool]]. */
final class BouncePoolIO(config: ColonnadeConfig) extends Bundle {

  /** The register `shading.offset`; constant while the pool is busy. */
  val offset  = Input(UInt((config.numbers.gridBits - 2).W))
  val job     = Flipped(Decoupled(new BounceJob(config)))
  val bounced = Decoupled(new BouncedRay(config))
}

/** Bounce units side by side. A job goes to a unit that is free; the rays leave in any order, and one that is offered stays
  * until it is taken.
  */
final class BouncePool(config: ColonnadeConfig, count: Int) extends Module {
  private val scene = new RayFormats(config.numbers).scene

  val io = IO(new BouncePoolIO(config))

  private val dispatcher = Module(new Dispatcher(new BounceJob(config), count)).io
  dispatcher.items :<>= io.job

  private val results = dispatcher.takers.map { job =>
    val unit = Module(new BounceUnit(config)).io
    unit.offset        := io.offset
    unit.request.valid := job.valid
    unit.request.bits  := job.bits.request
    job.ready          := unit.request.ready
    val ray = Wire(Decoupled(new BouncedRay(config)))
    ray.valid         := unit.result.valid
    ray.bits.bounce   := unit.result.bits
    ray.bits.albedo   := RegEnable(job.bits.albedo, job.fire)
    ray.bits.isTinted := RegEnable(job.bits.isTinted, job.fire)
    for (origin <- ray.bits.fresnelOrigin; (to, from) <- origin.axes.zip(job.bits.request.origin.axes))
      to := Fixed(scene, RegEnable(from, job.fire))
    unit.result.ready := ray.ready
    ray
  }

  // The ray that was offered in the cycle before and not taken
  private val waiting = RegInit(0.U(count.W))
  private val turns   = Module(new RoundRobin(count)).io
  private val grant   = Mux(waiting.orR, waiting, turns.grant)
  turns.requests := VecInit(results.map(_.valid)).asUInt
  turns.isTaken  := io.bounced.fire
  waiting        := Mux(io.bounced.ready, 0.U, grant)
  io.bounced.valid := turns.requests.orR
  io.bounced.bits  := Mux1H(grant, results.map(_.bits))
  results.zip(grant.asBools).foreach { case (ray, isGranted) => ray.ready := isGranted && io.bounced.ready }
}
