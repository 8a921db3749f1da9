package colonnade.unit

import chisel3._
import chisel3.util.{Mux1H, PopCount}
import colonnade.common.{Choice, First}
import colonnade.config.PathConfig
import colonnade.shading.PathEnd

import scala.collection.mutable

/** Holds the state of every context and issues each one to its next stage, by the table of states in
  * docs/path-tracer.md; contains no arithmetic.
  *
  * Contexts are tokens: there are `contexts` of them, so no queue for contexts overflows. In each cycle, at most one
  * ended ray is resolved, one context leaves shadowTest, and one pixel retires; other transitions are independent.
  */
final class RtController(config: PathConfig) extends Module {
  private val contexts = config.contexts

  /** The number of contexts takes a cycle, as does a choice of one of them, the latter also with extra slices. */
  private val isLarge = config.isLarge

  val io = IO(new RtControllerIO(config))

  // What moves a context to another state: whether it happens, the context, the state
  private val moves = mutable.Buffer.empty[(Bool, UInt, ContextState.Type)]

  private val state     = RegInit(VecInit(Seq.fill(contexts)(ContextState.idle)))
  private val isShadow  = Reg(Vec(contexts, Bool()))
  private val hasColour = Reg(Vec(contexts, Bool()))

  /** The path has left no surface of the object: its ray is the primary one, or the first that it gathers in the room.
    */
  private val isStraight = Reg(Vec(contexts, Bool()))

  /** The camera sees the environment directly in this pixel. */
  private val isDirectView = ifEnvironment

  /** The ray is a Fresnel reflection whose path's bounce is deferred. */
  private val isFresnelReflection = ifEnvironment
  private val hasEnvironment      = io.environment.map(_.enabled).getOrElse(false.B)

  /** A hit of the ray still needs an occlusion test; it is tested. */
  private val mayBeHidden     = ifEnvironment
  private val isOcclusionTest = ifEnvironment
  private val hasOcclusion    = io.environment.map(_.occlusion).getOrElse(false.B) && hasEnvironment

  private val gather  = GatherProgress(config, io.gather)
  private val shadows = new ShadowProgress(config)
  io.idleCount     := count(isAt(ContextState.idle), atReset = contexts)
  io.raySetupCount := count(isAt(ContextState.raySetup))

  // Allocate an idle context
  private val free = choose(isAt(ContextState.idle), io.allocation.allocate).now
  io.allocation.free := free
  move(io.allocation.allocate, free.bits, ContextState.raySetup)
  when(io.allocation.allocate) {
    isShadow(free.bits)   := false.B
    isStraight(free.bits) := true.B
    hasColour(free.bits)  := false.B
    if (config.device.hasEnvironment) {
      isFresnelReflection(free.bits) := false.B
      isDirectView(free.bits)        := false.B
      mayBeHidden(free.bits)         := hasOcclusion
      isOcclusionTest(free.bits)     := false.B
    }
  }

  gather.start(io.allocation.allocate, free.bits)

  // Trace its ray
  private val ended = choose(isAt(ContextState.resolve), true.B)
  io.trace.query     := ended.now
  io.trace.queryNext := ended.following
  move(io.trace.entered.valid, io.trace.entered.bits, ContextState.traversing)
  for (ended <- Seq(io.trace.missesBox, io.trace.hasResult)) move(ended.valid, ended.bits, ContextState.resolve)

  // Resolve an ended ray
  private val resolved   = ended.now.bits
  private val hasVisible = io.trace.hasHit && !mayBeHidden(resolved)
  io.trace.startsShading := ended.now.valid && !isShadow(resolved) && hasVisible
  io.trace.isPrimary     := isStraight(resolved) && !gather.hasGathered(resolved)
  io.trace.readsDistance := 0.U.asTypeOf(io.trace.readsDistance)
  private val isOfRoom   = isStraight(resolved) && gather.hasGathered(resolved)
  private val afterTrace = Mux(isOfRoom, ContextState.lit, afterObject(resolved, afterMiss(resolved)))
  private val afterHit   = Mux(hasVisible, ContextState.shading, afterTrace)
  private val lightsLeft = shadows.end(ended.now.valid && isShadow(resolved), ended, io.trace.occlusion)
  move(ended.now.valid, resolved, Mux(isShadow(resolved), afterLights(resolved, lightsLeft), afterHit))
  if (config.device.hasEnvironment) when(ended.now.valid) {
    mayBeHidden(resolved)     := false.B
    isOcclusionTest(resolved) := !isShadow(resolved) && io.trace.hasHit && mayBeHidden(resolved)
  }

  // Results of the shader. A point of the environment has its shadow rays before it gathers, and none when it is back
  private val shaded = io.shaded.bits
  private val needs  = shaded.needsShadowRays.asUInt
  private val isBack = shaded.isOfEnvironment && gather.hasGathered(shaded.context)
  move(io.shaded.valid, shaded.context, afterLights(shaded.context, needs.orR && !isBack))
  gather.shade(shaded, io.shaded.valid)
  shadows.begin(io.shaded.valid, shaded.context, needs)
  private val bounced  = io.bounced.bits.context
  private val untraced = afterObject(bounced, ContextState.accumulatePending)
  move(io.bounced.valid, bounced, Mux(io.bounced.bits.isTraced, ContextState.raySetup, untraced))
  when(io.bounced.valid) {
    isStraight(bounced) := false.B
    if (config.device.hasEnvironment)
      mayBeHidden(bounced) := hasOcclusion && !io.bounced.bits.isInside && !gather.hasGathered(bounced)
  }
  move(io.fetchFailed.valid, io.fetchFailed.bits, ContextState.accumulatePending)

  // Issue rays from surfaces: shadow rays, one light after the other, and rays that gather light. A Fresnel reflection
  // has no shadow rays, so its previous ray is none
  private val isTested = isAt(ContextState.shadowTest)
  private val mayIssue = isTested.zip(isAt(ContextState.gatherPending)).map { case (isTested, gathers) =>
    isTested || (gather.isBuilt && gathers)
  }
  private val next         = choose(mayIssue, io.shadow.ready)
  private val leaving      = next.now.bits
  private val isGathered   = gather.isBuilt && !VecInit(isTested)(leaving)
  private val leaves       = io.shadow.ready && next.now.valid
  private val issuesShadow = leaves && !isGathered
  io.shadow.valid        := next.now.valid
  io.shadow.bits.context := leaving
  io.shadow.bits.light   := shadows.next(next, isFirst = !isShadow(leaving))
  shadows.trace(issuesShadow, leaving, io.shadow.bits.light)
  move(leaves, leaving, ContextState.raySetup)
  when(leaves) { isShadow(leaving) := !isGathered }
  io.shadow.bits.isGathered := isGathered
  gather.issue(leaves && isGathered, next, shadows.occlusions(next))
  if (config.device.hasEnvironment) when(leaves && isGathered) { mayBeHidden(leaving) := false.B }
  for (gathering <- io.gather) {
    gathering.bouncedPath.isStraight  := isStraight(gathering.bounced)
    gathering.bouncedPath.isScattered := gather.hasGathered(gathering.bounced)
  }

  // End paths: all shadow rays of the surface are traced, or the path meets the background
  private val isEnding = state.zip(isFresnelReflection).map { case (at, reflection) =>
    at === ContextState.accumulatePending || (at === ContextState.lit && !reflection)
  }
  private val last        = choose(isEnding, io.end.ready)
  private val ending      = last.now
  private val isLit       = state(ending.bits) === ContextState.lit
  private val isOfPoint   = isLit && gather.isOfEnvironment(last)
  private val isScattered = gather.hasGathered(ending.bits)
  private val gathers     = isLit && !isOfPoint && gather.mayGather(last)
  private val isInCube    = gather.isOn && (isScattered || !isStraight(ending.bits))
  private val hasReturned = gather.isBuilt && !isStraight(ending.bits)
  private val occlusions  = shadows.occlusions(last)
  private val seen        = Mux(hasReturned, PathEnd.gathered, PathEnd.directView)
  private val surface = Mux(isOfPoint && isDirectView(ending.bits), seen, Mux(gathers, PathEnd.gathers, PathEnd.lit))
  io.end.valid        := ending.valid
  io.end.bits.context := ending.bits
  io.end.bits.end     := Mux(isLit, surface, Mux(isInCube, PathEnd.cube, PathEnd.background))
  io.end.bits.isStraight.foreach(_ := isStraight(ending.bits))
  io.end.bits.occlusions  := VecInit(occlusions)
  io.end.bits.isScattered := isScattered
  io.end.bits.goesBack    := gather.isBuilt && isDirectView(ending.bits) && !isOfPoint && !gathers
  when(isOfPoint && isScattered) { io.end.bits.occlusions := VecInit(gather.before(last, occlusions)) }
  move(io.end.fire, ending.bits, ContextState.accumulating)

  // A path's colour is complete; or the light of a surface is added and the path gathers, or goes back to its point of
  // the environment with what it has gathered, and the point is shaded again
  private val goesOn      = gather.isBuilt && io.continued.valid
  private val goesBack    = io.continued.bits.goesBack
  private val accumulated = Mux(goesOn, io.continued.bits.context, io.accumulated.bits)
  private val afterLight  = Mux(goesBack, ContextState.environmentMarch, ContextState.gatherPending)
  assert(!(io.accumulated.valid && goesOn), "a path is complete or goes on")
  move(io.accumulated.valid || goesOn, accumulated, Mux(goesOn, afterLight, ContextState.done))
  when(io.accumulated.valid) { hasColour(accumulated) := true.B }
  when(goesOn) { isStraight(accumulated) := false.B }
  for (environment <- io.environment) {
    environment.again.valid := goesOn && goesBack
    environment.again.bits  := accumulated
  }

  // Retire pixels
  private val done = choose(isAt(ContextState.done), io.pixel.retire).now
  io.pixel.done      := done
  io.pixel.hasColour := hasColour(done.bits)
  move(io.pixel.retire, done.bits, ContextState.idle)

  // Rays that miss the object, hits that may be hidden, and bounces that wait for their Fresnel reflection
  for (environment <- io.environment) {
    move(environment.bypass.valid, environment.bypass.bits, ContextState.environmentPending)
    val reflection = environment.fresnelReflection
    move(reflection.valid, reflection.bits, ContextState.environmentPending)
    when(reflection.valid) {
      isFresnelReflection(reflection.bits) := true.B
      isStraight(reflection.bits)          := false.B
    }
    // A ray from the camera goes first, if it is accepted; no kind waits for the other
    val isServed            = Wire(Vec(2, Bool()))
    val Seq(camera, others) = Seq(true.B, false.B).zip(isServed).map { case (ofCamera, isServed) =>
      choose(
        isAt(ContextState.environmentPending).zip(isStraight).map { case (waits, is) => waits && is === ofCamera },
        isServed
      ).now
    }
    val isCamera = camera.valid && environment.accepts.directView
    val pending  = Mux(isCamera, camera.bits, others.bits)
    isServed(0)             := environment.req.fire && isCamera
    isServed(1)             := environment.req.fire && !isCamera
    io.environmentCount.get :=
      count(state.map(at => at === ContextState.environmentPending || at === ContextState.environmentMarch))
    // The distance of a hit is read through the port that serves the surfaces to shade
    val isTest = isOcclusionTest(pending)
    val isAny  = isCamera || (others.valid && environment.accepts.march)
    environment.req.valid                    := isAny && !(isTest && io.trace.startsShading)
    environment.req.bits.context             := pending
    environment.req.bits.isDirectView        := isStraight(pending)
    environment.req.bits.isFresnelReflection := isFresnelReflection(pending)
    environment.req.bits.isOcclusionTest     := isTest
    io.trace.readsDistance.valid             := environment.req.fire && isTest
    io.trace.readsDistance.bits              := pending
    move(environment.req.fire, pending, ContextState.environmentMarch)
    when(environment.req.fire) {
      isDirectView(pending) := environment.req.bits.isDirectView
      isShadow(pending)     := false.B
    }
    move(environment.hit.valid, environment.hit.bits, ContextState.shading)
    move(environment.visible.valid, environment.visible.bits, ContextState.resolve)
    when(environment.hit.valid) { isOcclusionTest(environment.hit.bits) := false.B }
    when(environment.visible.valid) {
      isDirectView(environment.visible.bits)    := false.B
      isOcclusionTest(environment.visible.bits) := false.B
    }
    val missed = environment.miss.bits
    move(environment.miss.valid, missed, Mux(isFresnelReflection(missed), ContextState.resumeBounce, afterMiss(missed)))
    val isResumable = state.zip(isFresnelReflection).map { case (at, reflection) =>
      at === ContextState.resumeBounce || (at === ContextState.lit && reflection)
    }
    val resumable = choose(isResumable, environment.resume.ready).now
    environment.resume.valid        := resumable.valid
    environment.resume.bits.context := resumable.bits
    environment.resume.bits.end     := Mux(
      state(resumable.bits) === ContextState.lit,
      PathEnd.lit,
      Mux(gather.isOn, PathEnd.cube, PathEnd.background)
    )
    move(environment.resume.fire, resumable.bits, ContextState.shading)
    when(environment.resume.fire) { isFresnelReflection(resumable.bits) := false.B }
  }

  // Move contexts: at most one cause moves a context in a cycle
  for ((at, context) <- state.zipWithIndex) {
    val isMoved = moves.toSeq.map { case (happens, moved, _) => happens && moved === context.U }
    val next    = Mux1H(isMoved, moves.toSeq.map { case (_, _, to) => to.asUInt })
    when(isMoved.reduce(_ || _)) { at := ContextState.safe(next)._1 }
    assert(PopCount(isMoved) <= 1.U, "two causes move a context")
  }

  private def move(happens: Bool, context: UInt, to: ContextState.Type): Unit = moves += ((happens, context, to))

  /** The next state of a ray that hits nothing; a primary ray's pixel has the background's colour. */
  private def afterMiss(context: UInt): ContextState.Type =
    Mux(isStraight(context), ContextState.done, ContextState.accumulatePending)

  /** The next state of a ray that leaves the object, and otherwise has the state `alone`. */
  private def afterObject(context: UInt, alone: ContextState.Type): ContextState.Type =
    Mux(hasEnvironment && !gather.hasGathered(context), ContextState.environmentPending, alone)

  /** The next state of a context whose shadow rays are traced, unless one is left. A point of the environment that the
    * camera sees gathers before it is lit.
    */
  private def afterLights(context: UInt, isLeft: Bool): ContextState.Type = {
    val gathers = gather.isOn && isDirectView(context) && !gather.hasGathered(context)
    Mux(isLeft, ContextState.shadowTest, Mux(gathers, ContextState.gatherPending, ContextState.lit))
  }

  /** A flag of each context, that is false without an environment. */
  private def ifEnvironment: Vec[Bool] =
    if (config.device.hasEnvironment) Reg(Vec(contexts, Bool())) else VecInit.fill(contexts)(false.B)

  private def isAt(wanted: ContextState.Type): Seq[Bool] = state.map(_ === wanted)

  /** The context that is served next, among the waiting ones. Of many contexts, and with extra slices, it is chosen one
    * cycle early.
    */
  private def choose(claims: Seq[Bool], isServed: => Bool): Choice =
    if (isLarge || config.device.units.extraSlices) First.registered(claims, isServed) else Choice(First(claims))

  /** Of many contexts, the number is the one of the cycle before. */
  private def count(claims: Seq[Bool], atReset: Int = 0): UInt = {
    val number = PopCount(claims)
    if (isLarge) RegNext(number, atReset.U) else number
  }
}
