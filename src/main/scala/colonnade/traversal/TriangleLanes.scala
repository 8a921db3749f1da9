package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, PopCount, RRArbiter}
import colonnade.common.Dispatcher
import colonnade.config.PartConfig

final class TriangleLanesIO(config: PartConfig) extends Bundle {
  val candidate = Flipped(Decoupled(new TriangleCandidate(config)))
  val readyNext = Output(Bool()) // `candidate` will be ready in the next cycle

  /** The results of one record stay in order. */
  val result = Decoupled(new TriangleResult(config))

  /** Lanes that accept a triangle's vertices. */
  val busy = Output(UInt(log2Ceil(config.device.units.triangleLanes + 1).W))
}

/** `units.triangleLanes` parallel [[TriangleUnit]]s with round-robin dispatch and round-robin collection of results.
  * A lane has the unit's latency and throughput.
  */
final class TriangleLanes(config: PartConfig) extends Module {
  val io = IO(new TriangleLanesIO(config))

  private val lanes    = Seq.fill(config.device.units.triangleLanes)(Module(new TriangleUnit(config)).io)
  private val dispatch = Module(new Dispatcher(new TriangleCandidate(config), lanes.size))
  private val results  = Module(new RRArbiter(new TriangleResult(config), lanes.size))

  dispatch.io.items :<>= io.candidate
  for (((lane, taker), result) <- lanes.zip(dispatch.io.takers).zip(results.io.in)) {
    lane.candidate :<>= taker
    result :<>= lane.result
  }
  io.result :<>= results.io.out
  io.readyNext := VecInit(lanes.map(_.readyNext)).asUInt.orR
  io.busy      := PopCount(lanes.map(_.busy))
}
