package colonnade.shading

import chisel3._
import chisel3.util.{Mux1H, PriorityEncoderOH}
import colonnade.config.PathConfig

/** [[BounceUnit]] with several hits at a time: docs/shading.md. Mirrors take a [[MirrorPipeline]], a hit every three cycles;
  * glass takes one of several units. Results come in any order; the hits in it are of different contexts.
  */
final class BouncePipeline(config: PathConfig) extends Module {
  val io = IO(new BounceUnitIO(config))

  private val mirrors = Module(new MirrorPipeline(config)).io
  private val glass   = Seq.fill(BouncePipeline.units)(Module(new BounceUnit(config)).io)
  private val units   = mirrors +: glass

  // A mirror waits for the pipeline, glass for an idle unit
  private val isGlass = io.request.bits.isGlass
  private val isIdle  = glass.map(_.request.ready)
  private val takes   = (!isGlass +: PriorityEncoderOH(isIdle).map(_ && isGlass))
  io.request.ready := Mux(isGlass, isIdle.reduce(_ || _), mirrors.request.ready)
  for ((unit, takes) <- units.zip(takes)) {
    unit.offset        := io.offset
    unit.request.valid := io.request.valid && takes
    unit.request.bits  := io.request.bits
  }
  io.busy := units.map(_.busy).reduce(_ || _)

  // A result is chosen, and offered until it is taken; the next one is another unit's
  private val chosen = RegInit(VecInit.fill(units.size)(false.B))
  private val others = units.zip(chosen).map { case (unit, isLast) => unit.result.valid && !isLast }
  when(!io.result.valid || io.result.ready) { chosen := VecInit(PriorityEncoderOH(others)) }
  io.result.valid                                             := chosen.reduce(_ || _)
  io.result.bits                                              := Mux1H(chosen, units.map(_.result.bits))
  for ((unit, isNext) <- units.zip(chosen)) unit.result.ready := isNext && io.result.ready
}

object BouncePipeline {
  val units: Int = 4 // units for glass: a hit at its front takes some 170 cycles in each
}
