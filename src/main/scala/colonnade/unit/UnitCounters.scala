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

/** Collects the events of a render unit from its stages. Stages name their events as `UnitEvents` does. */
object UnitCounters {
  def apply(
      config:      ColonnadeConfig,
      controller:  RtControllerIO,
      raySetup:    RaySetupIO,
      fetch:       FetchStageIO,
      intersector: IntersectorIO,
      shader:      ShaderIO,
      shadowRays:  ShadowRaysIO,
      bounces:     Option[BounceSchedulerIO],
      environment: Option[EnvironmentPortIO]
  ): UnitEvents = {
    val events = Wire(new UnitEvents(config))
    for (stage <- Seq(intersector.events, fetch.events); (name, event) <- stage.elements)
      events.elements(name) := event

    def anyBounce(event: BounceSchedulerIO => Bool): Bool = bounces.map(event).getOrElse(false.B)
    events.raysShadow     := shadowRays.ray.fire
    events.raysReflection := anyBounce(bounce => bounce.ray.fire && !bounce.isRefraction)
    events.raysRefraction := anyBounce(bounce => bounce.ray.fire && bounce.isRefraction)

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

    events.illegalRecord := fetch.events.illegalRecord || intersector.events.illegalRecord ||
      environment.map(_.events.illegal).getOrElse(false.B) || shader.isIllegalTexel.getOrElse(false.B)
    events
  }
}
