package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, PopCount, RRArbiter, Valid}
import colonnade.common.Dispatcher
import colonnade.config.PartConfig
import colonnade.formats.{Leaf, Vec3}
import colonnade.ray.TriangleRay

final class TriangleSequencerIO(config: PartConfig) extends Bundle {
  val candidate = Flipped(Decoupled(new TriangleCandidate(config)))
  val readyNext = Output(Bool()) // `candidate` will be ready in the next cycle
  val advances  = Input(Bool())  // the stages after this one accept `slot`
  val slot      = Output(new TriangleSlot)

  /** The vertex of `slot`, to be loaded in this cycle even if the pipeline stalls. */
  val vertex = Valid(Vec3(UInt(config.device.geometry.vertexBits.W)))
  val ray    = Output(new TriangleRay(config.numbers))

  /** The current round; valid with the vertex of its last slot. */
  val tag = Valid(new TriangleTag(config))
}

/** Sequences the vertices of a leaf in a round: 4 slots for a triangle, 5 for a pair; docs/traversal.md, triangle test.
  *
  * The gap frees the first register of the pipeline, so the last vertex never waits, and a round's end is known one
  * cycle before. The next candidate is accepted with the last vertex, so no slot is lost between rounds. Without a
  * record, a candidate is accepted in every second cycle.
  */
final class TriangleSequencer(config: PartConfig) extends Module {
  val io = IO(new TriangleSequencerIO(config))

  import TriangleStep._

  private val candidate = Reg(new TriangleCandidate(config))
  private val leaf      = new Leaf(config.device.geometry, candidate.record)
  private val hasRecord = RegInit(false.B) // the candidate has vertices to issue

  // Slots
  private val step     = RegInit(idle)
  private val isPair   = Reg(Bool())
  private val isLoaded = RegNext(step === last && !io.advances, false.B)
  private val issues   = step === last && !isLoaded
  when(step === idle) {
    when(io.candidate.fire) { step := first }
  }.elsewhen(io.advances) {
    when(step === first) { step := second }
    when(step === second) { step := Mux(leaf.isPair, third, gap) }
    when(step === third) { step := gap }
    when(step === gap) { step := last }
    when(step === last) { step := Mux((!issues && hasRecord) || io.candidate.fire, first, idle) }
  }
  when(step === second) { isPair := leaf.isPair }
  when(issues) { hasRecord := false.B }
  when(io.candidate.fire) {
    candidate := io.candidate.bits
    hasRecord := true.B
  }

  // A candidate is accepted with the last vertex of a record, or without a record
  private val isOpen = RegNext(io.readyNext, false.B)
  io.candidate.ready := isOpen
  // With extra slices after the last vertex: then no path leads from the pipeline to the record fetch
  private val ends = if (config.device.units.extraSlices) issues else step === gap && io.advances
  io.readyNext := ends || (!hasRecord && !isOpen)

  io.slot.step    := step
  io.slot.isPair  := isPair
  io.vertex.valid := Mux(step === last, issues, io.advances && step =/= idle && step =/= gap)
  io.vertex.bits  := leaf.vertex(
    Mux(step === first, 0.U, Mux(step === second, 1.U, Mux(step === last && isPair, 3.U, 2.U(2.W))))
  )
  io.ray := candidate.ray

  io.tag.valid               := issues
  io.tag.bits.context        := candidate.context
  io.tag.bits.id             := candidate.address ## 0.U(1.W)
  io.tag.bits.isPair         := isPair
  io.tag.bits.isTransmissive := leaf.isClear
  io.tag.bits.isNegative     := candidate.ray.orientation.negative(2)
  io.tag.bits.isMasked.zip(candidate.isMasked).foreach { case (to, from) => to := from }
}

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
