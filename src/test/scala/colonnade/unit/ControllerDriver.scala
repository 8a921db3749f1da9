package colonnade.unit

import chisel3._
import chiseltest._
import colonnade.shading.{Occlusion, PathEnd}

import scala.util.Random

/** A model of all contexts beside the controller; it drives random events that are legal in their states.
  *
  * @param hasEnvironment the frame has an environment, if the configuration has one
  * @param occlusion      it may hide the object
  * @param gathers        rays that a path gathers, if the configuration can
  * @param isLate         contexts are chosen one cycle early, so that a choice may come a cycle late
  */
private class ControllerDriver(
    dut:            RtController,
    count:          Int,
    seed:           Int,
    hasEnvironment: Boolean = false,
    occlusion:      Boolean = false,
    gathers:        Int = 0,
    isLate:         Boolean = false
) {
  private val random   = new Random(seed)
  private val lights   = dut.io.shaded.bits.needsShadowRays.size
  private val contexts = Seq.fill(count)(new ContextModel(lights))
  private var started  = 0
  dut.io.gather.foreach(_.bounces.poke(gathers))

  /** Points of the environment gather. */
  private val isInRoom = dut.io.environment.nonEmpty && gathers > 0

  /** Gathered rays of all paths; those of points of the environment that have met the object. */
  var gathered, returned = 0

  private var retired = 0

  /** Results of the environment march: of a Fresnel reflection or not, with a hit or without. */
  var outcomes = Set.empty[(Boolean, Boolean)]

  /** Results of occlusion tests: of a primary ray or not, hidden or visible. */
  var tests = Set.empty[(Boolean, Boolean)]

  private def contextsWith(claim: ContextModel => Boolean): Seq[Int] =
    contexts.indices.filter(index => claim(contexts(index)))

  private def at(state: ContextState.Type): Seq[Int] = contextsWith(_.state == state)

  private def needsShadow: Seq[Int] =
    contextsWith(context => context.state == ContextState.shadowTest)

  private def ending: Seq[Int] =
    contextsWith(context =>
      context.state == ContextState.accumulatePending ||
        (isShadowDone(context) && !context.isFresnelReflection)
    )

  private def resumable: Seq[Int] =
    contextsWith(context =>
      context.state == ContextState.resumeBounce || (isShadowDone(context) && context.isFresnelReflection)
    )

  private def isShadowDone(context: ContextModel): Boolean =
    context.state == ContextState.lit

  def run(pixels: Int, eagerness: Double): Unit = {
    def happens = random.nextDouble() < eagerness
    while (retired < pixels) cycle { events =>
      events.allocate = started < pixels && happens
      events.retire = happens
      events.shadow = happens
      events.end = happens
      events.march = happens
      events.resume = happens
      // Each stage names one context, and no two stages name the same one
      val (starting, passing) = random.shuffle(at(ContextState.raySetup)).partition(!contexts(_).bypasses)
      for (context <- starting.headOption if happens)
        if (random.nextInt(3) > 0) events.entered = Some(context) else events.missesBox = Some(context)
      for (context <- passing.headOption if happens) events.bypasses = Some(context)
      val traversing = random.shuffle(at(ContextState.traversing))
      for (context <- traversing.headOption if happens) events.hasResult = Some(context)
      val shading = random.shuffle(at(ContextState.shading))
      for (context <- shading.headOption if happens) finishShading(context, events)
      for (context <- shading.drop(1).find(contexts(_).willBounce.isEmpty) if happens && random.nextInt(3) == 0)
        events.fetchFailed = Some(context)
      for (context <- one(at(ContextState.environmentMarch)) if happens)
        if (contexts(context).goesBack || random.nextBoolean()) events.environmentHit = Some(context)
        else if (contexts(context).isOcclusionTest) events.visible = Some(context)
        else events.environmentMiss = Some(context)
      for (context <- one(at(ContextState.accumulating)) if happens)
        if (contexts(context).gathers || contexts(context).goesBack)
          events.continued = Some((context, contexts(context).goesBack))
        else events.accumulated = Some(context)
    }
    assert(started == pixels && at(ContextState.idle).size == count, "every pixel has retired")
  }

  private def finishShading(index: Int, events: ControllerEvents): Unit = {
    val context = contexts(index)
    if (!context.willBounce.getOrElse(random.nextInt(3) < (if (occlusion) 2 else 1)))
      events.shaded = Some(
        (index, Seq.fill(lights)(!context.isFresnelReflection && random.nextBoolean()), context.isOfEnvironment)
      )
    else if (hasEnvironment && context.willBounce.isEmpty && context.gathered == 0 && random.nextInt(4) > 0)
      events.fresnelReflection = Some(index)
    else {
      events.bounced = Some((index, random.nextInt(3) > 0))
      events.isInside = random.nextInt(4) == 0
    }
  }

  /** One cycle: checks all outputs, then drives the events that `happen` sets. */
  def cycle(happen: ControllerEvents => Unit): Unit = {
    dut.io.idleCount.expect(at(ContextState.idle).size)
    val free                  = shown(dut.io.allocation.free.valid, dut.io.allocation.free.bits, at(ContextState.idle))
    val resolved              = shown(dut.io.trace.query.valid, dut.io.trace.query.bits, at(ContextState.resolve))
    val done                  = shown(dut.io.pixel.done.valid, dut.io.pixel.done.bits, at(ContextState.done))
    val scattering            = at(ContextState.gatherPending)
    val (scattered, shadowed) =
      shown(dut.io.shadow.valid, dut.io.shadow.bits.context, needsShadow ++ scattering)
        .partition(scattering.contains)
    if ((scattered ++ shadowed).nonEmpty) dut.io.shadow.bits.isGathered.expect(scattered.nonEmpty)
    val ended = shown(dut.io.end.valid, dut.io.end.bits.context, ending)
    for (index <- resolved) {
      dut.io.trace.hasHit.poke(contexts(index).hasHit)
      dut.io.trace.occlusion.poke(contexts(index).occlusion)
      dut.io.trace.isPrimary.expect(contexts(index).isStraight && contexts(index).gathered == 0)
    }
    // The hit of an occlusion test is not read together with that of a surface
    val shades =
      resolved.exists(index => !contexts(index).isShadow && contexts(index).hasHit && !contexts(index).mayBeHidden)
    dut.io.trace.startsShading.expect(shades)
    // Rays from the camera go before others; each kind only if it is accepted
    val accepts = dut.io.environment.toSeq.flatMap { environment =>
      Seq(environment.accepts.directView, environment.accepts.march).map { port =>
        val isAccepted = random.nextInt(3) > 0
        port.poke(isAccepted)
        isAccepted
      }
    }
    val (camera, others) = at(ContextState.environmentPending).partition(contexts(_).isStraight)
    val pending          =
      if (accepts.headOption.contains(true) && camera.nonEmpty) camera
      else if (accepts.lastOption.contains(true)) others
      else Seq()
    val waits   = shades && pending.headOption.exists(contexts(_).isOcclusionTest)
    val marched = dut.io.environment.flatMap(environment =>
      shown(environment.req.valid, environment.req.bits.context, if (waits) Seq() else pending)
    )
    val resumed = dut.io.environment.flatMap(environment =>
      shown(environment.resume.valid, environment.resume.bits.context, resumable)
    )
    dut.io.environmentCount.foreach(
      _.expect(at(ContextState.environmentPending).size + at(ContextState.environmentMarch).size)
    )
    for ((context, index) <- contexts.zipWithIndex if context.state != ContextState.idle) {
      context.waited += 1
      assert(context.waited < 2000, s"context $index is stuck in ${context.state}")
    }
    for (index <- done) dut.io.pixel.hasColour.expect(contexts(index).hasColour)
    for (index <- shadowed.headOption)
      assert(contexts(index).shadowPending.contains(dut.io.shadow.bits.light.peekInt().toInt))
    for (index <- ended) {
      val context = contexts(index)
      dut.io.end.bits.end.expect(endOf(context))
      dut.io.end.bits.isStraight.foreach(_.expect(context.isStraight))
      dut.io.end.bits.isScattered.expect(context.gathered > 0)
      dut.io.end.bits.goesBack.expect(isReturning(context))
      val isOfRoom = context.isOfEnvironment && context.gathered > 0
      if (!context.isBackground)
        dut.io.end.bits.occlusions.zip(if (isOfRoom) context.kept else context.occlusions).foreach {
          case (port, occlusion) => port.expect(occlusion)
        }
    }
    val sampled = one(at(ContextState.shading)).filter(_ => dut.io.gather.nonEmpty)
    for (gather <- dut.io.gather; index <- sampled) {
      gather.bounced.poke(index)
      gather.bouncedPath.isStraight.expect(contexts(index).isStraight)
      gather.bouncedPath.isScattered.expect(contexts(index).gathered > 0)
      gather.sample.bits.poke(index)
    }
    dut.io.gather.foreach(_.sample.valid.poke(sampled.nonEmpty))

    for (environment <- dut.io.environment; index <- marched) {
      environment.req.bits.isDirectView.expect(contexts(index).isStraight)
      environment.req.bits.isFresnelReflection.expect(contexts(index).isFresnelReflection)
      environment.req.bits.isOcclusionTest.expect(contexts(index).isOcclusionTest)
    }
    for (environment <- dut.io.environment; index <- resumed) {
      val isMiss = contexts(index).isBackground
      environment.resume.bits.end.expect(if (!isMiss) PathEnd.lit else beyond(gathers > 0))
    }

    val events = new ControllerEvents
    happen(events)
    val allocated = free.filter(_ => events.allocate)
    val retires   = done.filter(_ => events.retire)
    val light     = dut.io.shadow.bits.light.peekInt().toInt
    for (environment <- dut.io.environment) environment.occlusion.poke(occlusion)
    events.poke(dut, allocated.nonEmpty, retires.nonEmpty, hasEnvironment)(random.nextInt(count))
    val measured = marched.filter(index => events.march && contexts(index).isOcclusionTest)
    dut.io.trace.readsDistance.valid.expect(measured.nonEmpty)
    for (index <- measured) dut.io.trace.readsDistance.bits.expect(index)
    for (again <- dut.io.environment.map(_.again)) {
      val returns = events.continued.filter(_._2).map(_._1)
      again.valid.expect(returns.nonEmpty)
      returns.foreach(again.bits.expect(_))
    }
    dut.clock.step()
    for (gather <- dut.io.gather; index <- sampled) gather.count.expect(contexts(index).gathered)

    def change(index: Option[Int])(how: ContextModel => Unit): Unit = index.foreach(index => how(contexts(index)))
    change(allocated) { context =>
      context.state = ContextState.raySetup
      context.isShadow = false
      context.isStraight = true
      context.hasColour = false
      context.isDirectView = false
      context.isFresnelReflection = false
      context.mayBeHidden = hasEnvironment && occlusion
      context.isOcclusionTest = false
      context.bypasses = hasEnvironment && random.nextInt(3) == 0
      context.gathered = 0
      context.isOfEnvironment = false
      context.goesBack = false
      started += 1
    }
    change(events.entered)(_.state = ContextState.traversing)
    change(resolved)(resolve)
    (events.missesBox ++ events.hasResult).foreach { index =>
      val context = contexts(index)
      context.state = ContextState.resolve
      context.hasHit = random.nextBoolean()
      context.occlusion = random.shuffle(Occlusion.all).head
    }
    for ((index, needs, _) <- events.shaded) change(Some(index)) { context =>
      context.isBackground = false
      context.shadowPending = if (context.goesBack) Nil else needs.indices.filter(needs(_))
      context.state = afterLights(context)
      context.occlusions = Seq.fill(lights)(Occlusion.none)
    }
    for ((index, isTraced) <- events.bounced) change(Some(index)) { context =>
      context.state = if (isTraced) ContextState.raySetup
      else if (hasEnvironment && context.gathered == 0) ContextState.environmentPending
      else ContextState.accumulatePending
      context.isStraight = false
      context.isBackground = true
      context.mayBeHidden = hasEnvironment && occlusion && !events.isInside && context.gathered == 0
    }
    change(events.fetchFailed) { context =>
      context.state = ContextState.accumulatePending
      context.isBackground = true
    }
    change(shadowed.headOption.filter(_ => events.shadow)) { context =>
      context.state = ContextState.raySetup
      context.isShadow = true
      context.shadowLight = light
      context.shadowPending = context.shadowPending.filter(_ != light)
    }
    change(scattered.headOption.filter(_ => events.shadow)) { context =>
      context.state = ContextState.raySetup
      context.isShadow = false
      context.mayBeHidden = false
      if (context.gathered == 0) context.kept = context.occlusions
      context.gathered += 1
      gathered += 1
    }
    change(ended.filter(_ => events.end)) { context =>
      context.gathers = isGathering(context)
      context.goesBack = isReturning(context)
      context.state = ContextState.accumulating
    }
    change(events.continued.map(_._1)) { context =>
      context.state = if (context.goesBack) ContextState.environmentMarch else ContextState.gatherPending
      context.isStraight = false
      if (context.goesBack) returned += 1
    }
    change(events.accumulated) { context =>
      context.state = ContextState.done
      context.hasColour = true
    }
    change(events.bypasses) { context =>
      context.state = ContextState.environmentPending
      context.bypasses = false
    }
    change(events.fresnelReflection) { context =>
      context.state = ContextState.environmentPending
      context.isFresnelReflection = true
      context.isStraight = false
    }
    change(marched.filter(_ => events.march)) { context =>
      context.state = ContextState.environmentMarch
      context.isDirectView = context.isStraight
      context.isShadow = false
    }
    change(events.environmentHit) { context =>
      context.state = ContextState.shading
      context.willBounce = Some(false)
      context.isOfEnvironment = true
      outcomes += ((context.isFresnelReflection, true))
      if (context.isOcclusionTest) tests += ((context.isStraight, true))
      context.isOcclusionTest = false
    }
    change(events.visible) { context =>
      context.state = ContextState.resolve
      context.isDirectView = false
      tests += ((context.isStraight, false))
      context.isOcclusionTest = false
    }
    change(events.environmentMiss) { context =>
      context.state = if (context.isFresnelReflection) ContextState.resumeBounce else afterMiss(context)
      context.isBackground = true
      outcomes += ((context.isFresnelReflection, false))
    }
    change(resumed.filter(_ => events.resume)) { context =>
      context.state = ContextState.shading
      context.isFresnelReflection = false
      context.willBounce = Some(true)
    }
    change(retires) { context =>
      context.state = ContextState.idle
      context.waited = 0
      retired += 1
    }
  }

  private def resolve(context: ContextModel): Unit =
    if (context.isShadow) {
      context.state = afterLights(context)
      context.occlusions = context.occlusions.updated(context.shadowLight, context.occlusion)
    } else if (context.hasHit && context.mayBeHidden) {
      context.state = ContextState.environmentPending
      context.mayBeHidden = false
      context.isOcclusionTest = true
      context.isBackground = false
    } else if (context.hasHit) {
      context.isOfEnvironment = false
      context.isBackground = false
      context.state = ContextState.shading
      context.willBounce = None
    } else if (context.isStraight && context.gathered > 0) context.state = ContextState.lit
    else {
      context.state =
        if (hasEnvironment && context.gathered == 0) ContextState.environmentPending else afterMiss(context)
      context.isBackground = true
    }

  /** The surface at which its path ends gathers light. */
  private def isGathering(context: ContextModel): Boolean =
    !context.isBackground && !context.isOfEnvironment && context.gathered < gathers

  /** Its ray is that of a point of the environment. */
  private def isReturning(context: ContextModel): Boolean =
    !isGathering(context) && isInRoom && context.isDirectView && !context.isOfEnvironment

  private def endOf(context: ContextModel): PathEnd.Type =
    if (context.isBackground) beyond(gathers > 0 && (context.gathered > 0 || !context.isStraight))
    else if (isGathering(context)) PathEnd.gathers
    else if (!context.isDirectView || !context.isOfEnvironment) PathEnd.lit
    else if (context.isStraight) PathEnd.directView
    else PathEnd.gathered

  private def beyond(isCube: Boolean): PathEnd.Type = if (isCube) PathEnd.cube else PathEnd.background

  private def afterLights(context: ContextModel): ContextState.Type =
    if (context.shadowPending.nonEmpty) ContextState.shadowTest
    else if (isInRoom && context.isDirectView && context.gathered == 0) ContextState.gatherPending
    else ContextState.lit

  private def afterMiss(context: ContextModel): ContextState.Type =
    if (context.isStraight) ContextState.done else ContextState.accumulatePending

  /** The context that the controller selects from `these`, if there are any. */
  private def shown(valid: Bool, bits: UInt, these: Seq[Int]): Option[Int] = {
    if (!isLate) valid.expect(these.nonEmpty, s"contexts $these")
    Option.when(valid.peekBoolean()) {
      val context = bits.peekInt().toInt
      assert(these.contains(context), s"context $context is not one of $these")
      context
    }
  }

  private def one(candidates: Seq[Int]): Option[Int] = random.shuffle(candidates).headOption
}
