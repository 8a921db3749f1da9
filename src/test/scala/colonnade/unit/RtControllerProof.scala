package colonnade.unit

import chisel3._
import chisel3.experimental.SourceInfo
import chisel3.util.{log2Ceil, PopCount, UIntToOH, Valid}
import colonnade.TestParts._
import colonnade.config.{ColonnadeConfig, PathConfig}
import colonnade.shading.{Occlusion, PathEnd}

/** Drives an [[RtController]] with any events of its stages. A stage answers for each context that it holds once, at
  * any time and in any order. A model of each path says where its context is, and what the controller has to do next.
  *
  * Rays that miss the object's box may have hits here: more than the stages do, and paths are shorter. Two contexts get
  * pixels; if there are more, the others stay idle.
  */
private[unit] final class RtControllerProof(config: ColonnadeConfig) extends Module {
  private val contexts = config.units.pathContexts
  private val lights   = config.frame.lights
  private val used     = 2
  private val isLarge  = PathConfig(config).isLarge
  require(contexts >= used && lights >= 2)

  val io = IO(new RtControllerIO(config))
  io :<>= Module(new RtController(config)).io

  private val environment = io.environment.toSeq
  private val enabled     = environment.map(_.enabled).headOption.getOrElse(false.B)
  private val mayHide     = environment.map(_.occlusion).headOption.getOrElse(false.B) && enabled
  private val isFirst     = RegNext(false.B, true.B)
  for (flag <- Seq(enabled, mayHide)) assume(isFirst || flag === RegNext(flag), "constant in a frame")
  assume(!io.continued.valid, "no path gathers")

  private val paths                          = RegInit(VecInit.fill(used)(0.U.asTypeOf(new PathModel(lights))))
  private def path(context: UInt): PathModel = paths(context(0))

  // Each stage answers for its contexts
  private val shaded  = (io.shaded.valid, io.shaded.bits.context)
  private val bounced = (io.bounced.valid, io.bounced.bits.context)
  answer(Place.raySetup, (Seq(io.trace.entered, io.trace.missesBox) ++ environment.map(_.bypass)).map(event))
  answer(Place.traversal, Seq(event(io.trace.hasResult)))
  answer(Place.shader, Seq(shaded, bounced, event(io.fetchFailed)) ++ environment.map(_.fresnelReflection).map(event))
  answer(Place.march, environment.flatMap(march => Seq(march.hit, march.miss, march.visible)).map(event))
  answer(Place.colour, Seq(event(io.accumulated)))

  // Pixels get contexts that are idle
  private val free = io.allocation.free
  assume(!io.allocation.allocate || (free.valid && free.bits < used.U))
  assert(
    free.valid === isOffered(
      paths.map(_.isAt(Place.idle)) ++ Seq.fill(contexts - used)(true.B),
      event(free),
      io.allocation.allocate
    ),
    "an idle context is free"
  )
  assert(!free.valid || free.bits >= used.U || path(free.bits).isAt(Place.idle), "a free context is idle")
  assert(io.idleCount === count(_.isAt(Place.idle), contexts - used, atReset = contexts), "no context is lost")
  assert(io.raySetupCount === count(_.isAt(Place.raySetup)), "contexts in ray set-up are counted")
  on(io.allocation.allocate, free.bits) { path =>
    path           := 0.U.asTypeOf(path)
    path.place     := Place.raySetup
    path.isPrimary := true.B
    path.needsTest := mayHide
  }

  // Rays are traced
  on(io.trace.entered)(_.place := Place.traversal)
  for (ended <- Seq(io.trace.missesBox, io.trace.hasResult)) on(ended)(_.place := Place.toResolve)

  // One ended ray is resolved
  private val resolved = path(io.trace.query.bits)
  private val isHit    = io.trace.hasHit && !resolved.isShadow
  private val tests    = isHit && resolved.needsTest
  assume(!io.trace.query.valid || !resolved.isTest || io.trace.hasHit, "a visible hit stays a hit")
  offer(Place.toResolve, event(io.trace.query), io.trace.query.valid, "an ended ray is resolved, once")
  assert(!io.trace.query.valid || io.trace.isPrimary === resolved.isPrimary, "a primary ray or another one")
  assert(io.trace.startsShading === (io.trace.query.valid && isHit && !tests), "a visible hit is shaded")
  if (isLarge) {
    val next = io.trace.queryNext
    assert(io.trace.query.valid === RegNext(next.valid, false.B), "the next ended ray is known")
    assert(!io.trace.query.valid || io.trace.query.bits === RegNext(next.bits), "the next ended ray is that one")
  }
  on(io.trace.query) { path =>
    path.needsTest := false.B
    path.isTest    := tests
    path.mayBounce := true.B
    path.mayBeLit  := true.B
    when(path.isShadow) {
      path.met(path.light) := io.trace.occlusion
      path.place           := path.afterLights(path.lightsLeft)
    }.elsewhen(tests) { path.place := Place.toMarch }
      .elsewhen(isHit) { path.place := Place.shader }
      .otherwise { path.place := Mux(enabled, Place.toMarch, path.afterMiss) }
  }

  // The shader finds a surface or a bounce. A Fresnel reflection needs no shadow ray
  private val needs = io.shaded.bits.needsShadowRays.asUInt
  permit(shaded)(path => path.mayBeLit && (!path.isReflection || needs === 0.U))
  permit(bounced)(_.mayBounce && config.frame.hasBounces.B)
  permit(event(io.fetchFailed))(path => path.mayBounce && path.mayBeLit)
  on(io.shaded.valid, io.shaded.bits.context) { path =>
    path.hasSurface := true.B
    path.needs      := needs
    path.issued     := 0.U
    path.place      := path.afterLights(needs)
  }
  on(io.bounced.valid, io.bounced.bits.context) { path =>
    path.hasSurface := false.B
    path.isPrimary  := false.B
    path.needsTest  := mayHide && !io.bounced.bits.isInside
    path.place      := Mux(io.bounced.bits.isTraced, Place.raySetup, Mux(enabled, Place.toMarch, Place.toEnd))
  }
  on(io.fetchFailed)(_.place := Place.toEnd)

  // Each light that needs a shadow ray gets one
  private val shadow = io.shadow.bits
  offer(
    Place.toShadow,
    (io.shadow.valid, shadow.context),
    io.shadow.ready,
    "a path with a light left gets a shadow ray"
  )
  assert(
    !io.shadow.valid || path(shadow.context).lightsLeft(shadow.light),
    "a shadow ray for a light that needs one, once"
  )
  on(io.shadow.fire, shadow.context) { path =>
    path.isShadow := true.B
    path.light    := shadow.light
    path.issued   := path.issued | UIntToOH(shadow.light, lights)
    path.place    := Place.raySetup
  }

  // Paths end
  private val end   = io.end.bits
  private val ended = path(end.context)
  private val isLit = io.end.valid && end.end =/= PathEnd.background
  offer(Place.toEnd, (io.end.valid, end.context), io.end.ready, "a path ends, once")
  private val surface = Mux(ended.isDirectView, PathEnd.directView, PathEnd.lit)
  assert(
    !io.end.valid || end.end === Mux(ended.hasSurface, surface, PathEnd.background),
    "a path ends at its surface, or one of the environment that the camera sees, or the background"
  )
  assert(!isLit || ended.lightsLeft === 0.U, "a path ends after its shadow rays")
  for (light <- 0 until lights)
    assert(
      !isLit || end.occlusions(light) === Mux(ended.needs(light), ended.met(light), Occlusion.none),
      "what the shadow ray to each light has met"
    )
  for (isStraight <- end.isStraight)
    assert(!io.end.valid || isStraight === ended.isPrimary, "straight without a bounce")
  on(io.end.fire, end.context)(_.place := Place.colour)
  on(io.accumulated) { path =>
    path.hasColour := true.B
    path.place     := Place.toRetire
  }

  // Pixels retire
  private val done = io.pixel.done
  assume(!io.pixel.retire || done.valid)
  offer(Place.toRetire, event(done), io.pixel.retire, "a pixel retires after its path, once")
  assert(!done.valid || io.pixel.hasColour === path(done.bits).hasColour, "a colour if it is accumulated")
  on(io.pixel.retire, done.bits)(_.place := Place.idle)

  // With an environment
  for (environment <- environment) {
    val request = environment.req.bits
    val asked   = path(request.context)
    permit(event(environment.bypass))(path => enabled && path.isPrimary && !path.isShadow)
    permit(event(environment.fresnelReflection))(path =>
      enabled && path.mayBounce && path.mayBeLit && config.frame.hasBounces.B
    )
    permit(event(environment.miss))(!_.isTest)
    permit(event(environment.visible))(_.isTest)
    on(environment.bypass)(_.place := Place.toMarch)
    on(environment.fresnelReflection) { path =>
      path.isReflection := true.B
      path.isPrimary    := false.B
      path.place        := Place.toMarch
    }

    // Rays from the camera go first, if they are accepted. A test waits while a surface is read
    val Seq(camera, others) = Seq(true.B, false.B).map { ofCamera =>
      val fires = environment.req.fire && asked.isPrimary === ofCamera
      isOffered(
        paths.map(path => path.isAt(Place.toMarch) && path.isPrimary === ofCamera),
        (fires, request.context),
        fires
      )
    }
    val isCamera = camera && environment.accepts.directView
    val isAny    = isCamera || (others && environment.accepts.march)
    val waits    = asked.isTest && io.trace.startsShading
    assert(environment.req.valid === (isAny && !waits), "a ray that is accepted marches")
    when(isAny) {
      assert(request.context < used.U && asked.isAt(Place.toMarch), "a ray marches once")
      assert(asked.isPrimary === isCamera, "a ray from the camera goes first")
      assert(request.isDirectView === asked.isPrimary, "a march for the camera or another ray")
      assert(request.isFresnelReflection === asked.isReflection, "a march for a Fresnel reflection or another ray")
      assert(request.isOcclusionTest === asked.isTest, "an occlusion test or a march")
    }
    assert(
      io.trace.readsDistance.valid === (environment.req.fire && asked.isTest),
      "the hit of an occlusion test is read"
    )
    assert(!io.trace.readsDistance.valid || io.trace.readsDistance.bits === request.context, "the hit of that test")
    on(environment.req.fire, request.context)(_.place := Place.march)
    on(environment.hit) { path =>
      path.isDirectView := path.isPrimary
      path.isTest       := false.B
      path.mayBounce    := false.B
      path.mayBeLit     := true.B
      path.place        := Place.shader
    }
    on(environment.visible)(_.place := Place.toResolve)
    on(environment.miss)(path => path.place := Mux(path.isReflection, Place.toResume, path.afterMiss))
    assert(
      io.environmentCount.get === count(path => path.isAt(Place.toMarch) || path.isAt(Place.march)),
      "contexts at the march are counted"
    )

    // Deferred bounces resume
    val resume = environment.resume
    offer(Place.toResume, (resume.valid, resume.bits.context), resume.ready, "a deferred bounce resumes, once")
    assert(
      !resume.valid || resume.bits.end === Mux(path(resume.bits.context).hasSurface, PathEnd.lit, PathEnd.background),
      "a reflection of a surface or the background"
    )
    on(resume.fire, resume.bits.context) { path =>
      path.isReflection := false.B
      path.mayBounce    := true.B
      path.mayBeLit     := false.B
      path.place        := Place.shader
    }

    cover(isAny && waits, "a test waits for a surface")
    cover(environment.visible.valid, "a hit is visible")
    cover(environment.hit.valid && path(environment.hit.bits).isTest, "a hit is hidden")
    if (!isLarge) {
      cover(resume.fire && resume.bits.end === PathEnd.lit, "a reflection has a surface")
      cover(io.end.valid && ended.isDirectView && ended.isShadow, "a shadow on the environment")
    }
  }

  // What has to happen for this to say something, in the cycles that the proofs have
  private val retired  = RegInit(false.B)
  private val finished = path(done.bits)
  when(io.pixel.retire) { retired := true.B }
  cover(io.pixel.retire && !finished.hasColour, "a pixel of the background")
  if (isLarge) cover(paths.map(_.isAt(Place.toResolve)).reduce(_ && _), "two ended rays wait")
  else cover(paths.map(!_.isAt(Place.idle)).reduce(_ && _) && retired, "a context has a second pixel")
  if (!config.hasEnvironment) {
    cover(isLit && ended.issued =/= 0.U, "a path ends after a shadow ray")
    if (!isLarge) {
      cover(isLit && ended.issued.andR && end.occlusions(0) =/= end.occlusions(1), "shadow rays meet different things")
      cover(io.pixel.retire && finished.isShadow && !finished.isPrimary, "a shadow after a bounce")
    }
  }

  /** A stage names contexts that it holds, and each one once. */
  private def answer(stage: Place.Type, events: Seq[(Bool, UInt)]): Unit = {
    for ((valid, context) <- events) assume(!valid || (context < used.U && path(context).isAt(stage)))
    for (((valid, context), i) <- events.zipWithIndex; (other, same) <- events.drop(i + 1))
      assume(!(valid && other && context === same))
  }

  private def event(port: Valid[UInt]): (Bool, UInt) = (port.valid, port.bits)

  private def permit(event: (Bool, UInt))(isLegal: PathModel => Bool): Unit =
    assume(!event._1 || isLegal(path(event._2)))

  private def on(event: Valid[UInt])(change: PathModel => Unit): Unit = on(event.valid, event.bits)(change)

  private def on(happens: Bool, context: UInt)(change: PathModel => Unit): Unit =
    when(happens) { change(path(context)) }

  /** The controller offers a context that waits there, and none else. */
  private def offer(wanted: Place.Type, port: (Bool, UInt), isServed: Bool, text: String)(implicit
      source: SourceInfo
  ): Unit = {
    val (valid, context) = port
    val isRight          = context < used.U && path(context).isAt(wanted)
    assert(valid === isOffered(paths.map(_.isAt(wanted)), port, isServed) && (!valid || isRight), text)
  }

  /** One of the claims is offered at once; of many contexts, in the next cycle. */
  private def isOffered(claims: Seq[Bool], port: (Bool, UInt), isServed: Bool): Bool = {
    val (valid, context) = port
    val left = claims.zipWithIndex.map { case (claim, i) => claim && !(valid && isServed && context === i.U) }
    if (isLarge) RegNext(left.reduce(_ || _), false.B) else claims.reduce(_ || _)
  }

  private def count(is: PathModel => Bool, others: Int = 0, atReset: Int = 0): UInt = {
    val number = PopCount(paths.map(is(_))) +& others.U
    if (isLarge) RegNext(number, atReset.U) else number
  }
}

/** Where a context is: in a stage, or in the controller until its next step. */
private[unit] object Place extends ChiselEnum {
  val idle, raySetup, traversal, shader, march, colour        = Value
  val toResolve, toMarch, toShadow, toResume, toEnd, toRetire = Value
}

/** What is known of a path by the events so far. */
private[unit] final class PathModel(lights: Int) extends Bundle {
  val place = Place()

  /** Its ray is the primary one, a shadow ray, the Fresnel reflection of a deferred bounce. */
  val isPrimary    = Bool()
  val isShadow     = Bool()
  val isReflection = Bool()

  /** A hit of its ray may be hidden by the environment; it has one, which is tested. */
  val needsTest = Bool()
  val isTest    = Bool()

  /** The shader may find a bounce; a surface that ends the path. */
  val mayBounce = Bool()
  val mayBeLit  = Bool()

  /** Such a surface is found; it is of the environment and directly seen; the colour is accumulated. */
  val hasSurface   = Bool()
  val isDirectView = Bool()
  val hasColour    = Bool()

  /** By light: it needs a shadow ray, it has got one, and what that one has met; the light of the last one. */
  val needs  = UInt(lights.W)
  val issued = UInt(lights.W)
  val met    = Vec(lights, Occlusion())
  val light  = UInt(log2Ceil(lights).W)

  def isAt(wanted: Place.Type): Bool      = place === wanted
  def lightsLeft: UInt                    = needs & (~issued).asUInt
  def afterLights(left: UInt): Place.Type =
    Mux(left =/= 0.U, Place.toShadow, Mux(isReflection, Place.toResume, Place.toEnd))
  def afterMiss: Place.Type = Mux(isPrimary, Place.toRetire, Place.toEnd)
}
