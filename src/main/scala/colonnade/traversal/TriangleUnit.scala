package colonnade.traversal

import chisel3._
import chisel3.util.{Decoupled, Queue, RegEnable}
import colonnade.common.Context
import colonnade.config.PartConfig

final class TriangleUnitIO(config: PartConfig) extends Bundle {
  val candidate = Flipped(Decoupled(new TriangleCandidate(config)))
  val result    = Decoupled(new TriangleResult(config))
  val readyNext = Output(Bool()) // `candidate` will be ready in the next cycle
  val busy      = Output(Bool()) // a round of vertices enters the unit
}

/** A triangle that waits for its place in the order of results; a crossed one also waits for its distance. */
final private class PendingTriangle(config: PartConfig) extends Bundle {
  val context         = Context(config)
  val isLast          = Bool()
  val isTransmissive  = Bool()
  val crossesTriangle = Bool()
}

/** Watertight test of a ray against the triangles of a record (after Woop, Benthin and Wald 2013, in integers);
  * docs/traversal.md. The hit table compares the result with the closest hit so far.
  *
  * Throughput: a pair every 5 cycles, a triangle every 4 cycles; one result for each triangle, in order. Latency of a
  * miss: 11 cycles, in a pair 10 and 12. A triangle that the ray's line crosses takes about 30 cycles plus a quarter of
  * the quotient's digits, one every 7 cycles or one per rotation of the dividers, whichever is longer. Sequencer, shear
  * and edges stall together, when a triangle's edges are known and the next stage is full. The stages ahead share
  * nothing with them, so these always make progress.
  *
  * A triangle in a plane through the ray misses.
  *
  * @param distanceLanes number of dividers
  * @param queueDepth    triangles that may wait for their result or for an earlier one
  */
final class TriangleUnit(config: PartConfig, distanceLanes: Int = 1, queueDepth: Int = 8) extends Module {
  val io = IO(new TriangleUnitIO(config))

  private val sequencer = Module(new TriangleSequencer(config))
  private val shear     = Module(new ShearStage(config))
  private val edges     = Module(new EdgeStage(config.numbers))
  private val weights   = Module(new WeightStage(config))
  private val numerator = Module(new NumeratorStage(config))
  private val distance  = Module(new DistanceStage(config, distanceLanes))
  private val pending   = Module(new Queue(new PendingTriangle(config), queueDepth))

  // The path of every triangle
  private val advances = Wire(Bool())
  sequencer.io.candidate <> io.candidate
  io.readyNext          := sequencer.io.readyNext
  sequencer.io.advances := advances
  shear.io.advances     := advances
  shear.io.slot         := sequencer.io.slot
  shear.io.vertex       := sequencer.io.vertex
  shear.io.ray          := sequencer.io.ray
  edges.io.advances     := advances
  edges.io.slot         := shear.io.shearedSlot
  edges.io.sheared      := shear.io.sheared

  // A round's tag moves with its last vertex: one in the shear, one in the edge stage
  private val sheared = RegEnable(sequencer.io.tag.bits, sequencer.io.tag.valid)
  private val tested  = RegEnable(sheared, advances && shear.io.shearedSlot.step === TriangleStep.last)

  // The edge functions decide
  private val isSecond        = edges.io.isSecond
  private val crossesTriangle = edges.io.crossesTriangle && !tested.isMasked.getOrElse(false.B)
  private val isTaken         = pending.io.enq.ready && (!crossesTriangle || weights.io.crossed.ready)
  private val decides         = edges.io.decides && isTaken
  advances := !edges.io.decides || isTaken

  pending.io.enq.valid                := decides
  pending.io.enq.bits.context         := tested.context
  pending.io.enq.bits.isLast          := isSecond || !tested.isPair
  pending.io.enq.bits.isTransmissive  := tested.isTransmissive
  pending.io.enq.bits.crossesTriangle := crossesTriangle

  // The path of crossed triangles
  weights.io.crossed.valid           := decides && crossesTriangle
  weights.io.crossed.bits.magnitudes := edges.io.magnitudes
  weights.io.crossed.bits.depths     := shear.io.depths(isSecond)
  weights.io.crossed.bits.id         := tested.id + isSecond
  weights.io.crossed.bits.backSide   := edges.io.isPositive =/= tested.isNegative
  numerator.io.weighted <> weights.io.weighted
  distance.io.request <> numerator.io.request

  // Results in order
  private val head    = pending.io.deq.bits
  private val isReady = !head.crossesTriangle || distance.io.hit.valid
  io.result.valid               := pending.io.deq.valid && isReady
  io.result.bits.context        := head.context
  io.result.bits.isLast         := head.isLast
  io.result.bits.isTransmissive := head.isTransmissive
  io.result.bits.isHit          := head.crossesTriangle && distance.io.hit.bits.t.integer >= 0.S
  io.result.bits.hit            := distance.io.hit.bits
  pending.io.deq.ready          := io.result.ready && isReady
  distance.io.hit.ready         := io.result.fire && head.crossesTriangle

  io.busy := sequencer.io.slot.step =/= TriangleStep.idle
}
