package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, RegEnable, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.EnvironmentView
import colonnade.shading.EnvironmentSurface

/** The ray of a context, for the table of [[EnvironmentStage]]. */
final class StoredRay(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val ray     = new EnvironmentRay(config)
}

/** Ports of [[EnvironmentStage]]. */
final class EnvironmentStageIO(config: ColonnadeConfig) extends Bundle {

  /** Constant while a frame runs. */
  val view = Input(new EnvironmentView(config.numbers))

  /** Stored in place of the context's previous ray. */
  val ray = Flipped(Valid(new StoredRay(config)))

  val req = Flipped(Decoupled(new EnvironmentRequest(config)))

  /** In the cycle after an occlusion test's `req`: the distance of its hit. */
  val hitDistance = Input(HitDistance(config))

  /** The result: a point to shade, a context whose ray misses, or one whose occlusion test finds its hit visible. */
  val surface = Decoupled(new EnvironmentSurface(config))
  val miss    = Valid(Context(config))
  val visible = Valid(Context(config))
  val maps    = new AttributePort(AttributeLayout.of(config), AttributePort.tagBits(config))
  val events  = Output(new MarchEvents)
}

/** Stores each context's ray, and finds the points of the environment that the rays hit, one at a time; see
  * [[EnvironmentMarch]].
  */
final class EnvironmentStage(config: ColonnadeConfig) extends Module {
  val io = IO(new EnvironmentStageIO(config))

  private val march = Module(new EnvironmentMarch(config))
  private val rays  = ContextTable(config, new EnvironmentRay(config))
  when(io.ray.valid) { rays.write(io.ray.bits.context, io.ray.bits.ray) }

  // A ray is read in the cycle after its request, and held until the march takes it with its result
  private val isTaken = RegInit(false.B)
  private val isHeld  = RegInit(false.B)
  private val req     = RegEnable(io.req.bits, io.req.fire)
  private val read    = rays.read(io.req.bits.context, io.req.fire)
  private val held    = RegEnable(read, isTaken)
  io.req.ready := !isTaken && (!isHeld || march.io.request.ready)
  isTaken      := io.req.fire
  when(isTaken) { isHeld := true.B }.elsewhen(march.io.request.ready) { isHeld := false.B }

  march.io.view                      := io.view
  march.io.request.valid             := isHeld
  march.io.request.bits.context      := req.context
  march.io.request.bits.isDirectView := req.isDirectView
  march.io.request.bits.ray          := held
  march.io.request.bits.hitDistance  := RegEnable(io.hitDistance, isTaken)
  io.maps <> march.io.maps
  io.events := march.io.events

  private val result = march.io.result
  private val isHit  = Mux(req.isOcclusionTest, result.bits.hidesObject, result.bits.kind =/= HitKind.miss.U)
  io.surface.valid        := result.valid && isHit
  io.surface.bits.context := result.bits.context
  io.surface.bits.point   := result.bits.point
  io.surface.bits.normal  := result.bits.normal
  io.surface.bits.shadows := !req.isFresnelReflection
  io.surface.bits.albedo.channels.zip(Seq(result.bits.albedo.r, result.bits.albedo.g, result.bits.albedo.b)).foreach {
    case (to, from) => to := from
  }
  io.miss.valid    := result.valid && !isHit && !req.isOcclusionTest
  io.miss.bits     := result.bits.context
  io.visible.valid := result.valid && !isHit && req.isOcclusionTest
  io.visible.bits  := result.bits.context
  result.ready     := !isHit || io.surface.ready
}
