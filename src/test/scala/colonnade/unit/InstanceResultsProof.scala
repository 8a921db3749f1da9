package colonnade.unit

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.PathConfig
import colonnade.shading.Occlusion

/** Drives [[InstanceResults]] with rays of any context that enter objects or miss them, and whose results come in any
  * order, at any time: each visit is resolved once, by the next instance or by the ray's end.
  *
  * @param limit cycles in which one of the contexts that have a result goes on
  */
class InstanceResultsProof(config: PathConfig, limit: Int) extends Module {
  private object Stage extends ChiselEnum { val idle, waiting, sent, found = Value }

  private val contexts = config.contexts
  private val dut      = Module(new InstanceResults(config)).io

  val count   = IO(Input(chiselTypeOf(dut.count)))
  val begins  = IO(Input(Bool()))
  val shadow  = IO(Input(Bool()))
  val begun   = IO(Input(chiselTypeOf(dut.results.bits.context)))
  val leaves  = IO(Input(Bool()))
  val enters  = IO(Input(Bool()))
  val visited = IO(Input(chiselTypeOf(dut.visited.bits)))
  val ends    = IO(Input(Bool()))
  val result  = IO(Input(chiselTypeOf(dut.objectResults.bits)))
  dut.count := count
  assume(count =/= 0.U && count <= config.device.frame.instances.U && count === RegNext(count, count))
  assume(result.occlusion.isValid)

  // What the contexts do, as the rest of the walk sees it
  private val stage    = RegInit(VecInit.fill(contexts)(Stage.idle))
  private val instance = Reg(Vec(contexts, chiselTypeOf(visited.visit.instance)))
  private val isShadow = Reg(Vec(contexts, Bool()))
  private val hasHit   = Reg(Vec(contexts, Bool()))
  private val isOpaque = Reg(Vec(contexts, Bool()))

  when(begins && stage(begun) === Stage.idle) {
    stage(begun)    := Stage.waiting
    instance(begun) := 0.U
    isShadow(begun) := shadow
    hasHit(begun)   := false.B
    isOpaque(begun) := false.B
  }

  private val left = visited.visit.context
  private val goes = leaves && stage(left) === Stage.waiting
  dut.visited.valid               := goes
  dut.visited.bits                := visited
  dut.visited.bits.visit.instance := instance(left)
  dut.visited.bits.isShadow       := isShadow(left)
  dut.visited.bits.enters         := enters
  when(goes) { stage(left) := Mux(enters, Stage.sent, Stage.found) }

  private val traced = result.context
  dut.objectResults.valid := ends && stage(traced) === Stage.sent
  dut.objectResults.bits  := result
  when(dut.objectResults.valid) {
    stage(traced)    := Stage.found
    hasHit(traced)   := hasHit(traced) || (!isShadow(traced) && result.hasHit)
    isOpaque(traced) := isOpaque(traced) || (isShadow(traced) && result.occlusion === Occlusion.opaque)
  }

  private val again  = dut.again.bits.context
  private val isLast = instance(again) +& 1.U === count || isOpaque(again)
  assert(!(dut.again.valid && dut.results.valid), "a visit is resolved once")
  when(dut.again.valid) {
    assert(stage(again) === Stage.found && !isLast, "a ray goes on after a result, while there are instances")
    assert(dut.again.bits.instance === instance(again) +& 1.U, "instances are visited by ascending number")
    stage(again)    := Stage.waiting
    instance(again) := dut.again.bits.instance
  }

  private val done = dut.results.bits.context
  when(dut.results.valid) {
    assert(stage(done) === Stage.found, "a ray ends once, after a result")
    assert(instance(done) +& 1.U === count || isOpaque(done), "a ray ends after the last instance, or at an opaque one")
    assert(!dut.results.bits.hasHit || hasHit(done), "a hit is one of an instance")
    assert((dut.results.bits.occlusion === Occlusion.opaque) === isOpaque(done), "a shadow is that of an instance")
    stage(done) := Stage.idle
  }

  private val cycles = RegInit(0.U(log2Ceil(limit + 2).W))
  private val isBusy = stage.map(_ === Stage.found).reduce(_ || _)
  cycles := Mux(isBusy && !dut.again.valid && !dut.results.valid, cycles + 1.U, 0.U)
  assert(cycles <= limit.U, s"a context with a result goes on within $limit cycles")

  cover(dut.results.valid && instance(done) === 1.U && !isOpaque(done), "a ray ends after two instances")
  cover(dut.results.valid && instance(done) === 0.U && count =/= 1.U, "an opaque triangle ends a ray")
  cover(stage.map(_ === Stage.found).reduce(_ && _), "all contexts have a result")
  cover(dut.results.valid && dut.results.bits.hasHit, "a ray ends with a hit")
}
