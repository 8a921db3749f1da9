package colonnade.unit

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.PathConfig
import colonnade.shading.Occlusion

/** Drives [[InstanceResults]] with rays of any context and any mask, which enter objects or miss them, and whose
  * results come in any order, at any time: each visit is resolved once, by the next instance or by the ray's end.
  *
  * @param limit cycles in which one of the contexts that have a result goes on
  */
class InstanceResultsProof(config: PathConfig, limit: Int) extends Module {
  private object Stage extends ChiselEnum { val idle, waiting, found = Value }

  private val contexts = config.contexts
  private val dut      = Module(new InstanceResults(config)).io

  val begins  = IO(Input(Bool()))
  val begun   = IO(Input(chiselTypeOf(dut.steps.bits)))
  val scales  = IO(Input(chiselTypeOf(dut.scales)))
  val entries = IO(Input(chiselTypeOf(dut.entries)))
  val ends    = IO(Input(Bool()))
  val result  = IO(Input(chiselTypeOf(dut.objectResults.bits)))
  val fails   = IO(Input(Vec(2, Bool())))
  val failed  = IO(Input(Vec(2, chiselTypeOf(result.context))))
  assume(result.occlusion.isValid)
  dut.scales  := scales
  dut.entries := entries

  // What the contexts do, as the rest of the walk sees it
  private val stage    = RegInit(VecInit.fill(contexts)(Stage.idle))
  private val left     = Reg(Vec(contexts, chiselTypeOf(begun.left)))
  private val isShadow = Reg(Vec(contexts, Bool()))
  private val hasHit   = Reg(Vec(contexts, Bool()))
  private val isOpaque = Reg(Vec(contexts, Bool()))

  private val starts = begins && !dut.again.valid && stage(begun.context) === Stage.idle
  dut.steps := dut.again
  when(starts) {
    dut.steps.valid          := true.B
    dut.steps.bits           := begun
    dut.steps.bits.hasHit    := false.B
    dut.steps.bits.occlusion := Occlusion.none
    stage(begun.context)     := Stage.waiting
    left(begun.context)      := begun.left
    isShadow(begun.context)  := begun.isShadow
    hasHit(begun.context)    := false.B
    isOpaque(begun.context)  := false.B
  }

  private val traced = result.context
  dut.objectResults.valid := ends && stage(traced) === Stage.waiting
  dut.objectResults.bits  := result
  when(dut.objectResults.valid) {
    stage(traced)    := Stage.found
    hasHit(traced)   := hasHit(traced) || (result.hasHit && !isShadow(traced))
    isOpaque(traced) := isOpaque(traced) || (isShadow(traced) && result.occlusion === Occlusion.opaque)
  }
  for (((miss, asks), context) <- dut.misses.zip(fails).zip(failed)) {
    miss.valid := asks && stage(context) === Stage.waiting
    miss.bits  := context
    when(miss.fire) { stage(context) := Stage.found }
  }
  assume(!(fails(0) && fails(1) && failed(0) === failed(1)))

  private val again = dut.again.bits.context
  when(dut.again.valid) {
    val fallen = left(again) & (left(again) - 1.U)
    assert(stage(again) === Stage.found && !isOpaque(again), "a ray goes on after a result")
    assert(
      dut.again.bits.left === fallen && fallen =/= 0.U,
      "the lowest instance leaves the mask, while there are some"
    )
    stage(again) := Stage.waiting
    left(again)  := fallen
  }

  private val done  = dut.results.bits.context
  private val visit = dut.results.bits.visit.get
  private val isEnd = dut.results.valid && visit.isLast
  assert(!isEnd || !dut.again.valid, "a visit is resolved once")
  when(dut.results.valid) {
    assert(stage(done) === Stage.found, "a visit is resolved after its result")
    assert(!visit.isNearer || hasHit(done), "a hit is one of an instance")
    assert(left(done) === 0.U || left(done)(visit.instance), "its instance is one that the ray enters")
  }
  when(isEnd) {
    assert(
      (left(done) & (left(done) - 1.U)) === 0.U || left(done) === 0.U || isOpaque(done),
      "a ray ends after the last instance"
    )
    assert(!dut.results.bits.hasHit || hasHit(done), "a ray that hits has a hit of an instance")
    assert((dut.results.bits.occlusion === Occlusion.opaque) === isOpaque(done), "a shadow is that of an instance")
    stage(done) := Stage.idle
  }

  private val cycles = RegInit(0.U(log2Ceil(limit + 2).W))
  private val isBusy = stage.map(_ === Stage.found).reduce(_ || _)
  cycles := Mux(isBusy && !dut.again.valid && !isEnd, cycles + 1.U, 0.U)
  assert(cycles <= limit.U, s"a context with a result goes on within $limit cycles")

  cover(isEnd && isOpaque(done) && left(done) =/= 0.U, "an opaque triangle ends a ray")
  cover(dut.again.valid, "a ray goes on")
  cover(stage.map(_ === Stage.found).reduce(_ && _), "all contexts have a result")
  cover(isEnd && dut.results.bits.hasHit, "a ray ends with a hit")
}
