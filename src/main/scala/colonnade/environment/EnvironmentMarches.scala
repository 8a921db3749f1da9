package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, PopCount, PriorityEncoderOH, Queue, RRArbiter}
import colonnade.config.{AttributeLayout, PathConfig}
import colonnade.formats.EnvironmentView

/** Events of a column's marches in one cycle; names as in `Counters`. */
final class MarchSums(config: PathConfig) extends Bundle {
  private def perMarch = UInt(log2Ceil(config.device.units.marches + 1).W)

  val marchSteps      = perMarch
  val busyEnvironment = perMarch
  val illegalRecord   = Bool()
}

final class EnvironmentMarchesIO(config: PathConfig) extends Bundle {
  val view  = Input(new EnvironmentView(config.numbers)) // constant while a frame runs
  val paths = Flipped(new MarchPort(config))

  /** One for each march; the last one for the pipeline of directly seen pixels. */
  val maps   = Vec(config.device.mapRequesters, new AttributePort(AttributeLayout.of(config.device)))
  val events = Output(new MarchSums(config))
}

/** The marches of a column, and the pipeline for directly seen pixels. One request a cycle goes into the pipeline, or else
  * to an empty march; one answer every other cycle, by round-robin, goes back to the path unit.
  *
  * A march is empty once its answer has left it. An answer leaves as soon as the path unit stores no ray in the same cycle,
  * and it stores at most one ray for each of its contexts without an answer. So every request ends.
  */
final class EnvironmentMarches(config: PathConfig) extends Module {
  val io = IO(new EnvironmentMarchesIO(config))

  private val marches = Seq.fill(config.device.units.marches)(Module(new MarchSlot(config)).io)
  private val direct  = Module(new DirectView(config)).io

  // Requests: the order of one that is accepted comes in the next cycle
  private val isAwaited = RegInit(VecInit.fill(config.device.units.marches)(false.B))
  private val isFree    = VecInit(marches.zip(isAwaited).map { case (march, awaited) => march.isEmpty && !awaited })
  private val hasDirect = RegNext(io.paths.direct.fire, false.B)
  io.paths.direct.ready := direct.isReady && !hasDirect
  io.paths.march.ready  := isFree.asUInt.orR && !io.paths.direct.fire
  for ((awaited, free) <- isAwaited.zip(PriorityEncoderOH(isFree))) awaited := io.paths.march.fire && free

  // Marches, and directly seen pixels
  for (((march, awaited), maps) <- marches.zip(isAwaited).zip(io.maps)) {
    march.view        := io.view
    march.order.valid := awaited
    march.order.bits  := io.paths.order
    maps <> march.maps
  }
  direct.view        := io.view
  direct.order.valid := hasDirect
  direct.order.bits  := io.paths.order
  io.maps.last <> direct.maps

  // Answers
  private val answers = Module(new RRArbiter(new MarchAnswer(config), marches.size + 1)).io
  for ((in, answer) <- answers.in.zip(marches.map(_.answer) :+ direct.answer)) in :<>= answer
  io.paths.answer :<>= Queue(answers.out, 1)

  io.events.marchSteps      := PopCount(marches.map(_.events.step))
  io.events.busyEnvironment := PopCount(marches.map(_.events.busy))
  io.events.illegalRecord   := marches.map(_.events.illegal).reduce(_ || _) || direct.isIllegal
}
