package colonnade.unit

import chisel3._
import chisel3.util.Arbiter
import colonnade.config.ColonnadeConfig
import colonnade.ray.{RayRequest, RaySetup}
import colonnade.shading.{ColourUnit, Shader, ShadowRays}

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
final class RenderUnit(config: ColonnadeConfig) extends Module {
  val io = IO(new RenderUnitIO(config))

  private val controller  = Module(new RtController(config)).io
  private val primaryRays = Module(new PrimaryRays(config)).io
  private val rayArbiter  = Module(new Arbiter(new RayRequest(config), 3)).io
  private val raySetup    = Module(new RaySetup(config)).io
  private val fetch       = Module(new FetchStage(config)).io
  private val intersector = Module(new Intersector(config)).io
  private val shader      = Module(new Shader(config)).io
  private val shadowRays  = Module(new ShadowRays(config)).io
  private val colourUnit  = Module(new ColourUnit(config)).io
  private val assembler   = Module(new PixelAssembler(config)).io
  private val bounces     = Option.when(config.frame.hasBounces)(Module(new BounceScheduler(config)).io)
  private val environment = Option.when(config.hasRoom)(Module(new EnvironmentPort(config)).io)

  // A position gets an idle context, and the context a primary ray
  private val allocated = primaryRays.allocated
  primaryRays.positions :<>= io.positions
  primaryRays.free    := controller.free
  controller.allocate := allocated.valid
  assembler.allocated := allocated

  // Rays: those whose pixels are closer to their end have priority
  rayArbiter.in(0) :<>= shadowRays.ray
  rayArbiter.in(1).valid := false.B
  rayArbiter.in(1).bits  := DontCare
  for (bounces <- bounces) rayArbiter.in(1) :<>= bounces.ray
  rayArbiter.in(2) :<>= environment.map(_.objectRays).getOrElse(primaryRays.ray)
  raySetup.request :<>= rayArbiter.out
  intersector.rays :<>= raySetup.ray

  // Intersection: each record comes with the ray of its context
  fetch.ray     := intersector.entered
  fetch.fetches := intersector.fetches
  intersector.nodes :<>= fetch.nodes
  intersector.triangles :<>= fetch.triangles
  intersector.closestHit :<>= fetch.closestHit
  intersector.fetchError := fetch.traversalError
  fetch.readyNext        := VecInit(intersector.nodesReadyNext, intersector.trianglesReadyNext, shader.readyNext)
  fetch.broadcasts       := io.broadcasts
  io.requests :<>= fetch.requests

  // Ended traces: the controller resolves one a cycle
  controller.entered.valid := intersector.entered.valid
  controller.entered.bits  := intersector.entered.bits.context
  controller.ended         := intersector.ended
  controller.hasHit        := intersector.hasHit
  controller.occlusions    := intersector.occlusions
  controller.fetchFailed   := fetch.attributeError
  intersector.resolved     := controller.resolved
  intersector.isShadow     := controller.isShadow
  intersector.isPrimary    := controller.isPrimary

  // Shading: a lit surface ends its path, after a shadow ray to each light
  private val lit = shader.lit
  shader.request :<>= fetch.hits
  lit.ready                              := true.B
  controller.shaded.valid                := lit.valid
  controller.shaded.bits.context         := lit.bits.context
  controller.shaded.bits.needsShadowRays := lit.bits.needsShadowRays
  shadowRays.surface.valid               := lit.valid
  shadowRays.surface.bits                := lit.bits
  shadowRays.req :<>= controller.shadow

  // Bounces: a mirror or glass continues its path
  controller.bounced := 0.U.asTypeOf(controller.bounced)
  for (bounces <- bounces) {
    bounces.start.valid := allocated.valid
    bounces.start.bits  := allocated.bits.context
    bounces.in :<>= shader.bounced.get
    colourUnit.bounce.get :<>= bounces.update
    controller.bounced := bounces.bounced
  }

  // Rays that miss the object march through the environment
  for (environment <- environment) {
    environment.control :<>= controller.environment.get
    environment.primary :<>= primaryRays.ray
    environment.pixel       := primaryRays.pixel
    environment.meetsObject := primaryRays.meetsObject
    for (bounces <- bounces) environment.bounces.get :<>= bounces.environment.get
    shader.environment.get :<>= environment.surfaces
    io.maps.get <> environment.maps
  }

  // Colours, then pixels
  colourUnit.start.valid   := allocated.valid
  colourUnit.start.bits    := allocated.bits.context
  colourUnit.surface.valid := lit.valid
  colourUnit.surface.bits  := lit.bits
  colourUnit.end :<>= controller.end
  controller.accumulated.valid := colourUnit.colour.valid
  controller.accumulated.bits  := colourUnit.colour.bits.context
  assembler.colour             := colourUnit.colour
  assembler.entered            := intersector.entered
  assembler.hasSurface         := intersector.hasSurface
  assembler.surfaceHit         := intersector.surfaceHit
  assembler.done               := controller.done
  assembler.hasColour          := controller.hasColour(controller.done.bits)
  controller.retire            := assembler.retire
  io.pixels :<>= assembler.pixels

  // Registers
  private val registers = io.registers
  primaryRays.camera.camera    := registers.camera
  primaryRays.camera.unitShift := registers.frame.unitShift
  raySetup.bounds              := registers.bounds
  fetch.start                  := io.start
  fetch.row                    := io.row
  fetch.scene                  := registers.scene
  intersector.start            := io.start
  intersector.scene            := registers.scene
  shader.lights                := registers.lights
  shader.unitShift             := registers.frame.unitShift
  shader.shading               := registers.shading
  shader.materials             := registers.materials
  shadowRays.lights            := registers.lights
  shadowRays.unitShift         := registers.frame.unitShift
  colourUnit.ambient           := registers.ambient
  colourUnit.background        := registers.background
  colourUnit.shading           := registers.shading
  assembler.background         := registers.background
  bounces.foreach(_.shading := registers.shading)
  environment.foreach(_.view := registers.room.get)

  io.isIdle := controller.idleCount === config.array.contexts.U && assembler.isIdle
  io.events :=
    UnitCounters(config, controller, raySetup, fetch, intersector, shader, shadowRays, bounces, environment)
}
