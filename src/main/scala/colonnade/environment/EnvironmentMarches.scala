package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, DecoupledIO, Mux1H, OHToUInt, PopCount, PriorityEncoderOH, Queue, RegEnable}
import colonnade.common.RoundRobin
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.EnvironmentView

/** Events of a column's marches in one cycle; names as in `Counters`. */
final class MarchSums(config: ColonnadeConfig) extends Bundle {
  private def perMarch = UInt(log2Ceil(config.units.marches + 1).W)

  val marchSteps      = perMarch
  val busyEnvironment = perMarch
  val illegalRecord   = Bool()
}

/** Ports of [[EnvironmentMarches]]. */
final class EnvironmentMarchesIO(config: ColonnadeConfig) extends Bundle {

  /** Constant while a frame runs. */
  val view = Input(new EnvironmentView(config.numbers))

  /** One for each render unit; one for each march. */
  val units = Vec(config.array.rows, Flipped(new MarchPort(config)))
  val maps  =
    Vec(config.mapRequesters, new AttributePort(AttributeLayout.of(config), AttributePort.tagBits(config)))
  val events = Output(new MarchSums(config))
}

/** The marches that the render units of a column share, and with `units.directView` the pipeline for directly seen pixels.
  * One request a cycle goes into the pipeline, or else to an empty march, by round-robin for each; one answer every other
  * cycle, by round-robin, goes back to its unit.
  *
  * A march is empty once its answer has left it. An answer leaves as soon as its unit stores no ray in the same cycle, and
  * a unit stores at most one ray for each of its contexts without an answer. So every request ends.
  */
final class EnvironmentMarches(config: ColonnadeConfig) extends Module {
  val io = IO(new EnvironmentMarchesIO(config))

  private val marches = Seq.fill(config.units.marches)(Module(new MarchSlot(config)).io)
  private val direct  = Option.when(config.units.directView)(Module(new DirectView(config)).io)

  // Requests: a unit that is granted sends its order in the next cycle
  private val isAwaited = RegInit(VecInit.fill(config.units.marches)(false.B))
  private val isFree    = VecInit(marches.zip(isAwaited).map { case (march, awaited) => march.isEmpty && !awaited })
  private val mayDirect = RegInit(true.B) // no pixel came into the pipeline in the cycle before
  private val seenGrant = direct.fold(0.U)(pipeline => grant(io.units.map(_.direct.get), pipeline.isReady && mayDirect))
  private val toDirect  = seenGrant.orR
  private val rayGrant  = grant(io.units.map(_.march), isFree.asUInt.orR && !toDirect)
  private val grants    = seenGrant | rayGrant
  private val granted   = RegEnable(grants, grants.orR)
  private val order     = Wire(new RowOrder(config))
  order.row                                                                 := OHToUInt(granted)
  order.order                                                               := Mux1H(granted, io.units.map(_.order))
  mayDirect                                                                 := !toDirect
  for ((awaited, free) <- isAwaited.zip(PriorityEncoderOH(isFree))) awaited := rayGrant.orR && free

  // Marches
  private val marched = marches.zip(isAwaited).zip(io.maps).map { case ((march, awaited), maps) =>
    march.view        := io.view
    march.order.valid := awaited
    march.order.bits  := order.order
    maps <> march.maps
    val answer = Wire(Decoupled(new RowAnswer(config)))
    answer.valid       := march.answer.valid
    answer.bits.row    := RegEnable(order.row, awaited)
    answer.bits.answer := march.answer.bits
    march.answer.ready := answer.ready
    answer
  }

  // Directly seen pixels
  private val seen = direct.map { pipeline =>
    pipeline.view        := io.view
    pipeline.order.valid := !mayDirect
    pipeline.order.bits  := order
    io.maps.last <> pipeline.maps
    pipeline.answer
  }

  // Answers
  private val answers       = marched ++ seen
  private val answerArbiter = Module(new RoundRobin(answers.size)).io
  private val first         = Wire(Decoupled(new RowAnswer(config)))
  answerArbiter.requests := VecInit(answers.map(_.valid)).asUInt
  answerArbiter.isTaken  := first.fire
  first.valid            := answerArbiter.grant.orR
  first.bits             := Mux1H(answerArbiter.grant, answers.map(_.bits))
  answers.zip(answerArbiter.grant.asBools).foreach { case (answer, isFirst) => answer.ready := isFirst && first.ready }
  private val leaving = Queue(first, 1)
  leaving.ready := VecInit(io.units.zipWithIndex.map { case (unit, row) =>
    unit.answer.valid := leaving.valid && leaving.bits.row === row.U
    unit.answer.bits  := leaving.bits.answer
    unit.answer.ready && leaving.bits.row === row.U
  }).asUInt.orR

  io.events.marchSteps      := PopCount(marches.map(_.events.step))
  io.events.busyEnvironment := PopCount(marches.map(_.events.busy))
  io.events.illegalRecord   := marches.map(_.events.illegal).reduce(_ || _) || direct.fold(false.B)(_.isIllegal)

  /** Accepts one of the requests, by round-robin, if one may go; returns which one, one-hot. */
  private def grant(requests: Seq[DecoupledIO[EnvironmentRequest]], mayGo: Bool): UInt = {
    val arbiter = Module(new RoundRobin(config.array.rows)).io
    arbiter.requests := VecInit(requests.map(_.valid)).asUInt
    arbiter.isTaken  := mayGo
    val granted = Mux(mayGo, arbiter.grant, 0.U)
    requests.zip(granted.asBools).foreach { case (request, isGranted) => request.ready := isGranted }
    granted
  }
}
