package colonnade.shading

import chisel3._
import chisel3.util.{PriorityEncoderOH, RRArbiter}
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

  // Results in turn
  private val arbiter = Module(new RRArbiter(new BounceResult(config), units.size)).io
  arbiter.in.zip(units).foreach { case (in, unit) => in :<>= unit.result }
  io.result :<>= arbiter.out
  io.busy := units.map(_.busy).reduce(_ || _)
}

object BouncePool {

  /** A mirror every 8 cycles. */
  val units: Int = 6
}
