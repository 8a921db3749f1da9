package colonnade.unit

import chisel3._
import chisel3.util.{Arbiter, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.ray.{RayRequest, RaySetup}
import colonnade.shading.{ColourUnit, LitSurface, Shader, ShadowRays}

/** A render unit: converts pixel positions to pixels, with one ray in flight per context. {{{
  *
  * positions ─▶ PrimaryRays ─▶ RaySetup ─▶ Intersector ◀─▶ FetchStage ◀─▶ column (requests, broadcasts)
  *                               ▲   ▲                         │ hits with attributes
  *                 bounced rays  │   │ shadow rays             ▼
  *              BounceScheduler ─┘   └─ ShadowRays ◀──────── Shader ◀─ EnvironmentPort ◀─▶ column (maps)
  *                     └──────────────┬──────────────────────────┘
  *                                    ▼
  *                                ColourUnit ─▶ PixelAssembler ─▶ pixels
  * }}}
  * RtController holds the state of every context and issues it to its next stage. Pixels leave in any order; their order
  * depends on timing, their values do not.
  */
final class RenderUnit(config: ColonnadeConfig) extends RenderUnitModule(config) {
  private val controller  = Module(new RtController(config)).io
  private val primaryRays = Module(new PrimaryRays(config)).io
  private val raySetup    = Module(RaySetup(config)).io
  private val fetch       = Module(new FetchStage(config)).io
  private val intersector = Module(new Intersector(config)).io
  private val shader      = Module(new Shader(config)).io
  private val shadowRays  = Module(new ShadowRays(config)).io
  private val colourUnit  = Module(new ColourUnit(config)).io
  private val assembler   = Module(new PixelAssembler(config)).io
  private val bounces     = Option.when(config.frame.hasBounces)(Module(new BounceScheduler(config)).io)
  private val environment = Option.when(config.hasEnvironment)(Module(new EnvironmentPort(config)).io)

  // From a position to a prepared ray; rays whose pixels are closer to their end have priority
  primaryRays.positions :<>= io.positions
  private val tracedPrimary = environment.map(_.objectRays).getOrElse(primaryRays.ray)
  private val raySources    = Seq(shadowRays.ray) ++ bounces.map(_.ray) :+ tracedPrimary
  private val rayArbiter    = Module(new Arbiter(new RayRequest(config), raySources.size)).io
  rayArbiter.in.zip(raySources).foreach { case (in, rays) => in :<>= rays }
  raySetup.request :<>= rayArbiter.out
  intersector.rays :<>= raySetup.ray

  // Intersection: each record comes with the ray of its context
  io.requests :<>= fetch.requests
  fetch.broadcasts := io.broadcasts
  fetch.ray        := intersector.entered
  fetch.fetches    := intersector.fetches
  fetch.readyNext  := VecInit(intersector.nodesReadyNext, intersector.trianglesReadyNext, shader.readyNext)
  intersector.nodes :<>= fetch.nodes
  intersector.triangles :<>= fetch.triangles
  intersector.closestHit :<>= fetch.closestHit
  intersector.fetchError := fetch.traversalError

  // Shading: a lit surface ends its path, after a shadow ray to each light; a mirror or glass continues it
  private val lit = Wire(Valid(new LitSurface(config)))
  shader.request :<>= fetch.hits
  shader.lit.ready := true.B
  lit.valid        := shader.lit.valid
  lit.bits         := shader.lit.bits
  io.texture.zip(shader.texture).foreach { case (port, requests) => port <> requests }
  shadowRays.req :<>= controller.shadow
  shadowRays.surface := lit
  for (bounces <- bounces) {
    bounces.in :<>= shader.bounced.get
    colourUnit.bounce.get :<>= bounces.update
  }

  // Rays that miss the object, or whose hit may be hidden, march through the environment
  for (environment <- environment) {
    environment.primary :<>= primaryRays.ray
    environment.pixel       := primaryRays.pixel
    environment.meetsObject := primaryRays.meetsObject
    environment.hitDistance := intersector.surfaceHit.bits.distance.get
    for (bounces <- bounces) environment.bounces.get :<>= bounces.environment.get
    shader.environment.get :<>= environment.surfaces
    io.maps.zip(environment.maps).foreach { case (port, maps) => port <> maps }
    io.marches.zip(environment.marches).foreach { case (port, marches) => port :<>= marches }
  }

  // From a path to a pixel
  colourUnit.end :<>= controller.end
  colourUnit.surface   := lit
  assembler.allocated  := primaryRays.allocated
  assembler.hasSurface := intersector.hasSurface
  assembler.surfaceHit := intersector.surfaceHit
  assembler.colour     := colourUnit.colour
  io.pixels :<>= assembler.pixels

  // Control: the state of every context
  controller.allocation :<>= primaryRays.control
  controller.trace :<>= intersector.control
  controller.pixel :<>= assembler.control
  controller.shaded.valid                := lit.valid
  controller.shaded.bits.context         := lit.bits.context
  controller.shaded.bits.needsShadowRays := lit.bits.needsShadowRays
  controller.bounced                     := bounces.map(_.bounced).getOrElse(0.U.asTypeOf(controller.bounced))
  controller.fetchFailed                 := fetch.attributeError
  controller.accumulated.valid           := colourUnit.colour.valid
  controller.accumulated.bits            := colourUnit.colour.bits.context
  colourUnit.start                       := primaryRays.start
  bounces.foreach(_.start := primaryRays.start)
  environment.foreach(_.control :<>= controller.environment.get)
  io.isIdle := controller.idleCount === config.array.contexts.U && assembler.isIdle
  io.events :=
    UnitCounters(config, controller, raySetup, fetch, intersector, shader, shadowRays, bounces, environment)

  // Registers
  private val registers = io.registers
  private val unitShift = registers.frame.unitShift
  fetch.start                  := io.start
  intersector.start            := io.start
  fetch.row                    := io.row
  fetch.scene                  := registers.scene
  intersector.scene            := registers.scene
  primaryRays.camera.camera    := registers.camera
  primaryRays.camera.unitShift := unitShift
  raySetup.bounds              := registers.bounds
  shader.lights                := registers.lights
  shader.unitShift             := unitShift
  shader.shading               := registers.shading
  shader.materials             := registers.materials
  shadowRays.lights            := registers.lights
  shadowRays.unitShift         := unitShift
  colourUnit.ambient           := registers.ambient
  colourUnit.background        := registers.background
  colourUnit.shading           := registers.shading
  assembler.background         := registers.background
  bounces.foreach(_.shading := registers.shading)
  environment.foreach(_.view := registers.environment.get)
}
