package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, RegEnable, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.EnvironmentView
import colonnade.shading.EnvironmentSurface

/** The ray of a context, for the table of a stage. */
final class StoredRay(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val ray     = new EnvironmentRay(config)
}

/** Ports of [[EnvironmentStage]] and [[EnvironmentRays]]. */
final class EnvironmentStageIO(config: ColonnadeConfig) extends Bundle {

  /** Constant while a frame runs. */
  val view = Input(new EnvironmentView(config.numbers))

  /** Stored in place of the context's previous ray. */
  val ray = Flipped(Valid(new StoredRay(config)))

  /** Ready as [[accepts]] says of its kind. */
  val req     = Flipped(Decoupled(new EnvironmentRequest(config)))
  val accepts = Output(new EnvironmentAccepts)

  /** In the cycle after an occlusion test's `req`: the distance of its hit. */
  val hitDistance = Input(HitDistance(config))

  /** The result: a point to shade, a context whose ray misses, or one whose occlusion test finds its hit visible. */
  val surface = Decoupled(new EnvironmentSurface(config))
  val miss    = Valid(Context(config))
  val visible = Valid(Context(config))

  /** To the column: maps, or marches. */
  val maps =
    Option.when(!config.sharesMarches)(new AttributePort(AttributeLayout.of(config), AttributePort.tagBits(config)))
  val marches = Option.when(config.sharesMarches)(new MarchPort(config))

  /** Of a march of its own. */
  val events = Output(new MarchEvents)
}

/** Stores each context's ray, and finds the points of the environment that the rays hit, one at a time; see
  * [[EnvironmentMarch]].
  */
final class EnvironmentStage(config: ColonnadeConfig) extends Module {
  val io = IO(new EnvironmentStageIO(config))

  private val slot = Module(new MarchSlot(config))
  private val rays = ContextTable(config, new EnvironmentRay(config))
  when(io.ray.valid) { rays.write(io.ray.bits.context, io.ray.bits.ray) }

  // A ray is read in the cycle after its request
  private val isTaken = RegNext(io.req.fire, false.B)
  io.req.ready                   := !isTaken && slot.io.isReady
  io.accepts.directView          := io.req.ready
  io.accepts.march               := io.req.ready
  slot.io.view                   := io.view
  slot.io.order.valid            := isTaken
  slot.io.order.bits.request     := RegEnable(io.req.bits, io.req.fire)
  slot.io.order.bits.ray         := rays.read(io.req.bits.context, io.req.fire)
  slot.io.order.bits.hitDistance := io.hitDistance
  io.maps.get <> slot.io.maps
  io.events := slot.io.events

  private val answer = slot.io.answer
  private val isTest = answer.bits.isOcclusionTest
  private val isHit  = answer.bits.isHit
  io.surface.valid := answer.valid && isHit
  io.surface.bits  := answer.bits.surface
  io.miss.valid    := answer.valid && !isHit && !isTest
  io.miss.bits     := answer.bits.surface.context
  io.visible.valid := answer.valid && !isHit && isTest
  io.visible.bits  := answer.bits.surface.context
  answer.ready     := !isHit || io.surface.ready
}
