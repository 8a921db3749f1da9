package colonnade.unit

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.shading.Occlusion

/** The inputs of the controller in one cycle. */
private class ControllerEvents {
  var allocate    = false
  var retire      = false
  var entered     = Option.empty[Int]
  var missesBox   = Option.empty[Int]
  var hasResult   = Option.empty[Int]
  var shaded      = Option.empty[(Int, Seq[Boolean], Boolean)] // the lights that need a shadow ray; of the environment
  var bounced     = Option.empty[(Int, Boolean)]
  var isInside    = false
  var fetchFailed = Option.empty[Int]
  var shadow      = false
  var end         = false
  var accumulated = Option.empty[Int]

  /** A context, and whether the ray of a point of the environment is complete. */
  var continued = Option.empty[(Int, Boolean)]

  // With an environment
  var bypasses          = Option.empty[Int]
  var fresnelReflection = Option.empty[Int]
  var march             = false
  var environmentHit    = Option.empty[Int]
  var environmentMiss   = Option.empty[Int]
  var visible           = Option.empty[Int]
  var resume            = false

  /** @param other the context on ports that are not valid */
  def poke(dut: RtController, allocates: Boolean, retires: Boolean, hasEnvironment: Boolean)(other: => Int): Unit = {
    def name(port: Valid[UInt], context: Option[Int]): Unit = {
      port.valid.poke(context.nonEmpty)
      port.bits.poke(context.getOrElse(other))
    }
    dut.io.allocation.allocate.poke(allocates)
    dut.io.pixel.retire.poke(retires)
    dut.io.shadow.ready.poke(shadow)
    dut.io.end.ready.poke(end)
    name(dut.io.trace.entered, entered)
    name(dut.io.trace.missesBox, missesBox)
    name(dut.io.trace.hasResult, hasResult)
    dut.io.shaded.valid.poke(shaded.nonEmpty)
    for ((context, needs, isOfEnvironment) <- shaded) {
      dut.io.shaded.bits.context.poke(context)
      dut.io.shaded.bits.isOfEnvironment.poke(isOfEnvironment)
      dut.io.shaded.bits.needsShadowRays.zip(needs).foreach { case (port, need) => port.poke(need) }
    }
    dut.io.bounced.valid.poke(bounced.nonEmpty)
    for ((context, isTraced) <- bounced) {
      dut.io.bounced.bits.context.poke(context)
      dut.io.bounced.bits.isTraced.poke(isTraced)
      dut.io.bounced.bits.isInside.poke(isInside)
    }
    name(dut.io.fetchFailed, fetchFailed)
    name(dut.io.accumulated, accumulated)
    dut.io.continued.valid.poke(continued.nonEmpty)
    dut.io.continued.bits.context.poke(continued.map(_._1).getOrElse(other))
    dut.io.continued.bits.goesBack.poke(continued.exists(_._2))
    for (environment <- dut.io.environment) {
      environment.enabled.poke(hasEnvironment)
      environment.req.ready.poke(march)
      environment.resume.ready.poke(resume)
      name(environment.bypass, bypasses)
      name(environment.fresnelReflection, fresnelReflection)
      name(environment.hit, environmentHit)
      name(environment.miss, environmentMiss)
      name(environment.visible, visible)
    }
  }
}

/** The expected state of a context and of its path. */
private class ContextModel(lights: Int) {
  var state         = ContextState.idle
  var isShadow      = false
  var isStraight    = false // it has left no surface of the object
  var hasColour     = false
  var isBackground  = false
  var hasHit        = false
  var occlusion     = Occlusion.none
  var shadowPending = Seq.empty[Int]
  var shadowLight   = 0
  var occlusions    = Seq.fill(lights)(Occlusion.none)
  var waited        = 0

  /** The pixel shows the environment; its ray is a Fresnel reflection. */
  var isDirectView        = false
  var isFresnelReflection = false

  /** The ray's hit may be hidden; it is tested. */
  var mayBeHidden     = false
  var isOcclusionTest = false

  /** Rays that its path has gathered; its surface is of the environment; the light of its surface is added, and then it
    * gathers.
    */
  var gathered        = 0
  var isOfEnvironment = false
  var gathers         = false

  /** The ray of a point of the environment is complete, and what the shadow rays of that point have met. */
  var goesBack = false
  var kept     = Seq.empty[Occlusion.Type]

  /** Its primary ray cannot hit the object. */
  var bypasses = false

  /** The shader's result, if it is determined: a bounce, or a lit surface. */
  var willBounce = Option.empty[Boolean]
}
