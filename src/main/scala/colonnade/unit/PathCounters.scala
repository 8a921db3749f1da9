package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, PopCount}
import colonnade.config.{PartConfig, PathConfig}
import colonnade.ray.RaySetupIO
import colonnade.shading.{ShaderIO, ShadowRaysIO}

/** Counts the contexts in a stage, from entries and exits in each cycle. */
object Occupancy {
  def apply(config: PartConfig, enter: Seq[Bool], exit: Seq[Bool]): UInt = {
    val count = RegInit(0.U(log2Ceil(config.contexts + 1).W))
    count := count + PopCount(enter) - PopCount(exit)
    count
  }
}

/** Events of a [[PathUnit]] in one cycle; names as in `Counters`. */
final class PathEvents(config: PathConfig) extends Bundle {
  private def contexts = UInt(log2Ceil(config.contexts + 1).W)

  val raysShadow          = Bool()
  val raysReflection      = Bool()
  val raysRefraction      = Bool()
  val hits                = Bool()
  val busyRaySetup        = Bool()
  val busyShader          = Bool()
  val idleContexts        = contexts
  val contextsRaySetup    = contexts
  val contextsShading     = contexts
  val raysEnvironment     = Option.when(config.device.hasEnvironment)(Bool())
  val contextsEnvironment = Option.when(config.device.hasEnvironment)(contexts)
  val raysGather          = Bool()
  val illegalRecord       = Bool() // an illegal texel
}

/** Collects the events of a path unit from its stages. */
object PathCounters {
  def apply(
      config:     PathConfig,
      controller: RtControllerIO,
      raySetup:   RaySetupIO,
      trace:      TracePort,
      shader:     ShaderIO,
      shadowRays: ShadowRaysIO,
      bounces:    Option[BounceSchedulerIO]
  ): PathEvents = {
    val events = Wire(new PathEvents(config))

    def anyBounce(event: BounceSchedulerIO => Bool): Bool = bounces.map(event).getOrElse(false.B)
    events.raysShadow     := shadowRays.ray.fire && shadowRays.ray.bits.isShadow
    events.raysReflection := anyBounce(bounce => bounce.ray.fire && !bounce.isRefraction)
    events.raysRefraction := anyBounce(bounce => bounce.ray.fire && bounce.isRefraction)
    events.hits           := trace.surfaceHit.valid && trace.surfaceHit.bits.isPrimary

    events.busyRaySetup     := raySetup.busy
    events.busyShader       := shader.busy
    events.idleContexts     := controller.idleCount
    events.contextsRaySetup := controller.raySetupCount
    events.contextsShading  := Occupancy(
      config,
      shader.request.fire +: shader.environment.map(_.fire).toSeq,
      shader.lit.fire +: shader.bounced.map(_.fire).toSeq
    )

    events.raysGather := shadowRays.ray.fire && !shadowRays.ray.bits.isShadow
    events.raysEnvironment.foreach(_ := controller.environment.get.req.fire)
    events.contextsEnvironment.foreach(_ := controller.environmentCount.get)
    events.illegalRecord := shader.isIllegalTexel.getOrElse(false.B)
    events
  }
}
