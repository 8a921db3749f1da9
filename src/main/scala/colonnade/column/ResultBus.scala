package colonnade.column

import chisel3._
import chisel3.util.{Decoupled, Mux1H, RegEnable, Valid}
import colonnade.common.RoundRobin
import colonnade.config.{ColonnadeConfig, PathConfig}
import colonnade.unit.TraceResult

final class ResultBusIO(config: ColonnadeConfig) extends Bundle {

  /** By row. */
  val units   = Vec(config.array.rows, Flipped(Decoupled(new TraceResult(PathConfig(config)))))
  val results = Valid(new TraceResult(PathConfig(config)))
}

/** Collects the results of traversal units, by round-robin. Throughput: one per cycle. Latency: one cycle. */
final class ResultBus(config: ColonnadeConfig) extends Module {
  val io = IO(new ResultBusIO(config))

  private val arbiter  = Module(new RoundRobin(config.array.rows)).io
  private val isChosen = arbiter.grant.orR
  arbiter.requests := VecInit(io.units.map(_.valid)).asUInt
  arbiter.isTaken  := isChosen
  io.units.zip(arbiter.grant.asBools).foreach { case (unit, isGranted) => unit.ready := isGranted }
  io.results.valid := RegNext(isChosen, false.B)

  // Of legal outcomes one is chosen: a legal one
  private val result = suppressEnumCastWarning(Mux1H(arbiter.grant, io.units.map(_.bits)))
  io.results.bits := RegEnable(result, isChosen)
}
