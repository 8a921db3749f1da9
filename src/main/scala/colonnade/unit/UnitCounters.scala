package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, PopCount}
import colonnade.config.ColonnadeConfig
import colonnade.formats.UnitEvents
import colonnade.ray.RaySetupIO
import colonnade.shading.{ShaderIO, ShadowRaysIO}

/** Counts the contexts in a stage, from those that enter and leave it in each cycle. */
object Occupancy {
  def apply(config: ColonnadeConfig, enter: Seq[Bool], exit: Seq[Bool]): UInt = {
    val count = RegInit(0.U(log2Ceil(config.array.contexts + 1).W))
    count := count + PopCount(enter) - PopCount(exit)
    count
  }
}

/** Events of a [[PathUnit]] in one cycle; names as in `UnitEvents`. */
final class PathEvents(config: ColonnadeConfig) extends Bundle {
  private def contexts                               = UInt(log2Ceil(config.array.contexts + 1).W)
  private def ifRoom[T <: Data](event: T): Option[T] = Option.when(config.hasEnvironment)(event)

  val raysShadow          = Bool()
  val raysReflection      = Bool()
  val raysRefraction      = Bool()
  val hits                = Bool()
  val busyRaySetup        = Bool()
  val busyShader          = Bool()
  val idleContexts        = contexts
  val contextsRaySetup    = contexts
  val contextsShading     = contexts
  val raysEnvironment     = ifRoom(Bool())
  val contextsEnvironment = ifRoom(contexts)
  val marchSteps          = ifRoom(Bool())
  val busyEnvironment     = ifRoom(Bool())

  /** An illegal map entry or texel. */
  val illegalRecord = Bool()
}

/** Collects the events of a path unit from its stages. */
object PathCounters {
  def apply(
      config:      ColonnadeConfig,
      controller:  RtControllerIO,
      raySetup:    RaySetupIO,
      trace:       TracePort,
      shader:      ShaderIO,
      shadowRays:  ShadowRaysIO,
      bounces:     Option[BounceSchedulerIO],
      environment: Option[EnvironmentPortIO]
  ): PathEvents = {
    val events = Wire(new PathEvents(config))

    def anyBounce(event: BounceSchedulerIO => Bool): Bool = bounces.map(event).getOrElse(false.B)
    events.raysShadow     := shadowRays.ray.fire
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

    events.raysEnvironment.foreach(_ := controller.environment.get.req.fire)
    events.contextsEnvironment.foreach(_ := controller.environmentCount.get)
    events.marchSteps.foreach(_ := environment.get.events.step)
    events.busyEnvironment.foreach(_ := environment.get.events.busy)
    events.illegalRecord := environment.map(_.events.illegal).getOrElse(false.B) ||
      shader.isIllegalTexel.getOrElse(false.B)
    events
  }
}

/** Collects the events of a unit that traces rays; without the paths if another unit follows them. */
object UnitCounters {
  def apply(
      config:      ColonnadeConfig,
      paths:       Option[PathEvents],
      intersector: IntersectorIO,
      fetch:       FetchStageIO
  ): UnitEvents = {
    val events = WireInit(0.U.asTypeOf(new UnitEvents(config)))
    for (part <- Seq(intersector.events, fetch.events) ++ paths; (name, event) <- part.elements)
      events.elements(name) := event
    events.illegalRecord    := fetch.events.illegalRecord || intersector.events.illegalRecord ||
      paths.map(_.illegalRecord).getOrElse(false.B)
    events
  }
}
