package colonnade.shading

import chisel3._
import chisel3.util.{Mux1H, PriorityEncoderOH}
import colonnade.common.RoundRobin
import colonnade.config.ColonnadeConfig

/** Several [[BounceUnit]]s behind the ports of one: docs/bounce.md. Results come in any order. */
final class BouncePool(config: ColonnadeConfig) extends Module {
  val io = IO(new BounceUnitIO(config))

  private val units = Seq.fill(BouncePool.units)(Module(new BounceUnit(config)).io)

  // The first idle unit takes a request
  private val takes = PriorityEncoderOH(units.map(_.request.ready))
  io.request.ready := units.map(_.request.ready).reduce(_ || _)
  for ((unit, takes) <- units.zip(takes)) {
    unit.offset        := io.offset
    unit.request.valid := io.request.valid && takes
    unit.request.bits  := io.request.bits
  }

  // Results in turn. One that was offered and not taken is offered until it is
  private val turns   = Module(new RoundRobin(units.size)).io
  private val waiting = RegInit(0.U(units.size.W))
  private val grant   = Mux(waiting.orR, waiting, turns.grant)
  turns.requests                                                        := VecInit(units.map(_.result.valid)).asUInt
  turns.isTaken                                                         := io.result.fire
  waiting                                                               := Mux(io.result.ready, 0.U, grant)
  io.result.valid                                                       := turns.requests.orR
  io.result.bits                                                        := Mux1H(grant, units.map(_.result.bits))
  for ((unit, isGranted) <- units.zip(grant.asBools)) unit.result.ready := isGranted && io.result.ready
  io.busy                                                               := units.map(_.busy).reduce(_ || _)
}

object BouncePool {

  /** A mirror every 8 cycles. */
  val units: Int = 6
}
