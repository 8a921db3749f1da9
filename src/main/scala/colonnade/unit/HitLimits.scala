package colonnade.unit

import chisel3._
import chisel3.util.Valid
import colonnade.config.TraversalConfig
import colonnade.ray.{EntryLimits, PreparedRay}
import colonnade.traversal.TriangleResult

final class HitLimitsIO(config: TraversalConfig) extends Bundle {
  val rays   = Flipped(Valid(new PreparedRay(config)))
  val result = Input(new TriangleResult(config))
  val isHit  = Output(Bool())
}

/** Decides whether a result is a hit of its context's ray: not before its tMin, and of a triangle that it does not leave
  * out. Combinational, from the ray that the context got last. Source: docs/numbers.md, section 9.
  */
final class HitLimits(config: TraversalConfig) extends Module {
  val io = IO(new HitLimitsIO(config))

  private val table = Reg(Vec(config.contexts, new EntryLimits(config.numbers)))
  when(io.rays.valid) { table(io.rays.bits.context) := io.rays.bits.limits.get }

  private val limits   = table(io.result.context)
  private val filter   = limits.filter
  private val hit      = io.result.hit
  private val isBefore = hit.t.integer.asUInt < limits.tMin // a hit is at t ≥ 0
  private val isCulled = Mux(hit.backSide, filter.cullsBack, filter.cullsFront)
  io.isHit := io.result.isHit && !isBefore && !isCulled && !(filter.refusesClear && io.result.isTransmissive)
}
