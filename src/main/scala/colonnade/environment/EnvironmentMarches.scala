package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, Mux1H, PopCount, PriorityEncoderOH, PriorityMux, Valid}
import colonnade.common.RoundRobin
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
  val start = Input(Bool())                              // of a frame: its camera may be another one
  val paths = Flipped(new MarchPort(config))

  /** One for each march; the last one for the pipeline of directly seen pixels. */
  val maps   = Vec(config.device.mapRequesters, new AttributePort(AttributeLayout.of(config.device)))
  val events = Output(new MarchSums(config))
}

/** The marches of a column, and the pipeline for directly seen pixels. One request a cycle goes into the pipeline, or
  * else to an empty march. A march is empty once [[MarchHits]] takes its hit, by round-robin. From there hits go to the
  * pipeline's last stage, whose answers go back to the path unit.
  *
  * An answer leaves as soon as the path unit stores no ray in the same cycle, and it stores at most one ray for each of
  * its contexts without an answer. No answer waits for a request. So every request ends.
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
  private val camera = RegInit(0.U.asTypeOf(Valid(new CameraOrigin(config))))
  for (((march, awaited), maps) <- marches.zip(isAwaited).zip(io.maps)) {
    march.view        := io.view
    march.camera      := camera
    march.order.valid := awaited
    march.order.bits  := io.paths.order
    maps.tieOff()
    maps.cells <> march.maps.cells
    maps.planes <> march.maps.planes
  }
  direct.view        := io.view
  direct.order.valid := hasDirect
  direct.order.bits  := io.paths.order
  io.maps.last <> direct.maps

  // The camera's origin, once a ray of the first march is tested against all planes, in order
  private val test = marches.head.test
  when(test.valid) {
    camera.valid                         := camera.valid || test.bits.plane === (RayClip.planes - 1).U
    camera.bits.origin                   := test.bits.origin
    camera.bits.exponent                 := test.bits.exponent
    camera.bits.outside(test.bits.plane) := test.bits.isOutside
  }
  when(io.start) { camera.valid := false.B }

  // Hits, which read albedo and normal by the port of the first march; and answers
  private val arbiter = Module(new RoundRobin(marches.size)).io
  private val hits    = Module(new MarchHits(config)).io
  private val grants  = arbiter.grant.asBools
  arbiter.requests                                                := VecInit(marches.map(_.hit.valid)).asUInt
  arbiter.isTaken                                                 := hits.hit.fire
  hits.hit.valid                                                  := arbiter.requests.orR
  hits.hit.bits                                                   := PriorityMux(grants, marches.map(_.hit.bits))
  for ((march, isGranted) <- marches.zip(grants)) march.hit.ready := isGranted && hits.hit.ready
  hits.texel.valid                                                := marches.map(_.texel.valid).reduce(_ || _)
  hits.texel.bits := Mux1H(marches.map(march => march.texel.valid -> march.texel.bits))
  io.maps.head.albedo <> hits.albedo
  io.maps.head.normals <> hits.normals
  direct.march :<>= hits.point
  io.paths.answer :<>= direct.answer

  io.events.marchSteps      := PopCount(marches.map(_.events.step))
  io.events.busyEnvironment := PopCount(marches.map(_.events.busy))
  io.events.illegalRecord   := marches.map(_.events.illegal).reduce(_ || _) || hits.illegal || direct.isIllegal
}
