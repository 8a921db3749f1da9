package colonnade.traversal

import chisel3._
import chisel3.util.{Decoupled, Queue, RegEnable, Valid}
import colonnade.common.Context
import colonnade.config.ColonnadeConfig

final class TriangleUnitIO(config: ColonnadeConfig) extends Bundle {
  val candidate = Flipped(Decoupled(new TriangleCandidate(config)))
  val result    = Decoupled(new TriangleResult(config))

  /** `candidate` will be ready in the next cycle. */
  val takesNext = Output(Bool())

  /** A triangle's vertices go in. */
  val busy = Output(Bool())
}

/** A result's place in the order: crossed ones wait for their distance. */
final private class TriangleTurn(config: ColonnadeConfig) extends Bundle {
  val context   = Context(config)
  val isLast    = Bool()
  val isClear   = Bool()
  val isCrossed = Bool()
}

/** Watertight test of a ray against the triangles of a record (after Woop, Benthin and Wald 2013, in integers);
  * docs/numbers.md, section 4, without the comparison with the best hit so far.
  *
  * One triangle every 4 cycles, one result each, in order. A miss takes 11 cycles. A triangle that the ray's line
  * crosses goes on to weights, numerator and division: about 30 cycles and a quarter of the quotient's digits, one
  * every 8 cycles or every round of the division lanes, whichever is longer.
  *
  * {{{
  * candidate ▸ sequencer ▸ shear ▸ edges ▸ (crossed: weights ▸ numerator ▸ distance) ▸ result
  *                          ▲ ────────── two multiplications ───────┘
  * }}}
  *
  * Sequencer, shear and edges keep step with the schedule. Only its phase 1 can wait, when a triangle's edges are
  * known and nobody can take them; the shear's multipliers are then lent in every second cycle, so those ahead always
  * move on.
  *
  * A record with an illegal `count` gives one miss, its last. A triangle in a plane through the ray misses.
  *
  * @param distanceLanes divisions under way at the same time
  * @param turns         results that may wait for one that divides
  */
final class TriangleUnit(config: ColonnadeConfig, distanceLanes: Int = 1, turns: Int = 8) extends Module {
  val io = IO(new TriangleUnitIO(config))

  private val sequencer = Module(new TriangleSequencer(config))
  private val shear     = Module(new ShearStage(config))
  private val edges     = Module(new EdgeStage(config.numbers))
  private val weights   = Module(new WeightStage(config))
  private val numerator = Module(new NumeratorStage(config))
  private val distance  = Module(new DistanceStage(config, distanceLanes))
  private val order     = Module(new Queue(new TriangleTurn(config), turns))

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

  // The way of every triangle
  sequencer.io.candidate <> io.candidate
  io.takesNext     := sequencer.io.takesNext
  shear.io.vertex  := sequencer.io.vertex
  shear.io.ray     := sequencer.io.ray
  edges.io.sheared := shear.io.sheared

  // Tags keep up with their triangles: one being sheared, one whose edges are being made
  private val none    = 0.U.asTypeOf(Valid(new TriangleTag(config)))
  private val moves   = schedule.is(1) && schedule.advances
  private val sheared = RegEnable(sequencer.io.tag, none, moves)
  private val tested  = RegEnable(sheared, none, moves)

  // Phase 1: the edges decide
  private val isCrossed = edges.io.isCrossed && !tested.bits.isAbsent
  private val isTaken   = order.io.enq.ready && (!isCrossed || weights.io.crossed.ready)
  private val decides   = schedule.is(1) && tested.valid && !pauses
  schedule.advances := !pauses && (!decides || isTaken)

  order.io.enq.valid          := decides && isTaken
  order.io.enq.bits.context   := tested.bits.context
  order.io.enq.bits.isLast    := tested.bits.isLast
  order.io.enq.bits.isClear   := tested.bits.isClear
  order.io.enq.bits.isCrossed := isCrossed

  // The way of crossed triangles
  weights.io.crossed.valid           := decides && isTaken && isCrossed
  weights.io.crossed.bits.magnitudes := edges.io.magnitudes
  weights.io.crossed.bits.depths     := shear.io.depths
  weights.io.crossed.bits.id         := tested.bits.id
  weights.io.crossed.bits.backSide   := edges.io.isPositive =/= tested.bits.isNegative
  numerator.io.weighted <> weights.io.weighted
  shear.io.weighing <> numerator.io.weighing
  numerator.io.products := shear.io.products
  distance.io.question <> numerator.io.question

  // Results in order
  private val turn    = order.io.deq.bits
  private val isReady = !turn.isCrossed || distance.io.hit.valid
  io.result.valid        := order.io.deq.valid && isReady
  io.result.bits.context := turn.context
  io.result.bits.isLast  := turn.isLast
  io.result.bits.isClear := turn.isClear
  io.result.bits.isHit   := turn.isCrossed && distance.io.hit.bits.t.integer >= 0.S
  io.result.bits.hit     := distance.io.hit.bits
  order.io.deq.ready     := io.result.ready && isReady
  distance.io.hit.ready  := io.result.fire && turn.isCrossed

  io.busy := sequencer.io.tag.valid
}
