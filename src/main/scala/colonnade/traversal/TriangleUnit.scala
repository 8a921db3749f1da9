package colonnade.traversal

import chisel3._
import chisel3.util.{Decoupled, Queue, RegEnable, Valid}
import colonnade.common.Context
import colonnade.config.ColonnadeConfig

final class TriangleUnitIO(config: ColonnadeConfig) extends Bundle {
  val candidate = Flipped(Decoupled(new TriangleCandidate(config)))
  val result    = Decoupled(new TriangleResult(config))

  /** `candidate` will be ready in the next cycle. */
  val readyNext = Output(Bool())

  /** The unit accepts a triangle's vertices. */
  val busy = Output(Bool())
}

/** A triangle that waits for its place in the order of results; a crossed one also waits for its distance. */
final private class PendingTriangle(config: ColonnadeConfig) extends Bundle {
  val context         = Context(config)
  val isLast          = Bool()
  val isTransmissive  = Bool()
  val crossesTriangle = Bool()
}

/** Watertight test of a ray against the triangles of a record (after Woop, Benthin and Wald 2013, in integers);
  * docs/numbers.md, section 4. The hit table compares the result with the closest hit so far.
  *
  * Throughput: one triangle every 4 cycles, one result each, in order. Latency of a miss: 11 cycles. A triangle that the
  * ray's line crosses continues to weights, numerator and division. Its latency is about 30 cycles plus a quarter of the
  * quotient's digits; its throughput is one every 8 cycles or one per rotation of the dividers, whichever is longer.
  *
  * {{{
  * candidate ▸ sequencer ▸ shear ▸ edges ▸ (crossed: weights ▸ numerator ▸ distance) ▸ result
  *                          ▲ ────────── two multiplications ───────┘
  * }}}
  *
  * Sequencer, shear and edges follow the schedule. Only phase 1 can stall, when a triangle's edges are known and the
  * next stage is full. The numerator stage then gets the shear's multipliers in every second cycle, so the stages ahead
  * always make progress.
  *
  * A record with an illegal `count` gives one miss, its last. A triangle in a plane through the ray misses.
  *
  * @param distanceLanes number of dividers
  * @param queueDepth    triangles that may wait for their result or for that of an earlier one
  */
final class TriangleUnit(config: ColonnadeConfig, distanceLanes: Int = 1, queueDepth: Int = 8) extends Module {
  val io = IO(new TriangleUnitIO(config))

  private val sequencer = Module(new TriangleSequencer(config))
  private val shear     = Module(new ShearStage(config))
  private val edges     = Module(new EdgeStage(config.numbers))
  private val weights   = Module(new WeightStage(config))
  private val numerator = Module(new NumeratorStage(config))
  private val distance  = Module(new DistanceStage(config, distanceLanes))
  private val pending   = Module(new Queue(new PendingTriangle(config), queueDepth))

  // Schedule
  private val schedule = Wire(new TriangleSchedule)
  private val phase    = RegInit(0.U(2.W))
  when(schedule.advances) { phase := phase + 1.U }
  private val pauses = RegInit(false.B)
  pauses                := schedule.is(1) && !schedule.advances && !pauses
  schedule.phase        := phase
  schedule.pauses       := pauses
  sequencer.io.schedule := schedule
  shear.io.schedule     := schedule
  edges.io.schedule     := schedule

  // The path of every triangle
  sequencer.io.candidate <> io.candidate
  io.readyNext        := sequencer.io.readyNext
  shear.io.vertex     := sequencer.io.vertex
  shear.io.ray        := sequencer.io.ray
  shear.io.isOccupied := sequencer.io.tag.valid
  edges.io.sheared    := shear.io.sheared

  // Tags move with their triangles: one in the shear, one in the edge stage
  private val none       = 0.U.asTypeOf(Valid(new TriangleTag(config)))
  private val shiftsTags = schedule.is(1) && schedule.advances
  private val sheared    = RegEnable(sequencer.io.tag, none, shiftsTags)
  private val tested     = RegEnable(sheared, none, shiftsTags)
  edges.io.isOccupied  := sheared.valid
  edges.io.wasOccupied := tested.valid

  // Phase 1: the edge functions decide
  private val crossesTriangle = edges.io.crossesTriangle && !tested.bits.isAbsent
  private val isTaken         = pending.io.enq.ready && (!crossesTriangle || weights.io.crossed.ready)
  private val decides         = schedule.is(1) && tested.valid && !pauses
  schedule.advances := !pauses && (!decides || isTaken)

  pending.io.enq.valid                := decides && isTaken
  pending.io.enq.bits.context         := tested.bits.context
  pending.io.enq.bits.isLast          := tested.bits.isLast
  pending.io.enq.bits.isTransmissive  := tested.bits.isTransmissive
  pending.io.enq.bits.crossesTriangle := crossesTriangle

  // The path of crossed triangles
  weights.io.crossed.valid           := decides && isTaken && crossesTriangle
  weights.io.crossed.bits.magnitudes := edges.io.magnitudes
  weights.io.crossed.bits.depths     := shear.io.depths
  weights.io.crossed.bits.id         := tested.bits.id
  weights.io.crossed.bits.backSide   := edges.io.isPositive =/= tested.bits.isNegative
  numerator.io.weighted <> weights.io.weighted
  shear.io.weighing <> numerator.io.weighing
  numerator.io.products := shear.io.products
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

  io.busy := sequencer.io.tag.valid
}
