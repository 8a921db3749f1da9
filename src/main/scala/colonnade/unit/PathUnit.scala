package colonnade.unit

import chisel3._
import chisel3.util.{Arbiter, Decoupled, Valid}
import colonnade.common.TimingSlice
import colonnade.config.PathConfig
import colonnade.environment.MarchPort
import colonnade.formats.{FrameRegisters, Pixel, UnitPosition}
import colonnade.ray.{RayRequest, RaySetup}
import colonnade.numbers.Rounding
import colonnade.shading.{ColourUnit, CubePort, LightCube, LitSurface, SamplePoints, Shader, ShadowRays, TexturePort}

/** `registers` is constant while a frame runs. */
final class PathUnitIO(config: PathConfig) extends Bundle {
  val registers = Input(new FrameRegisters(config.device))
  val positions = Flipped(Decoupled(new UnitPosition(config.device)))
  val pixels    = Decoupled(new Pixel(config.device))
  val trace     = new TracePort(config)

  /** To the marches of the environment, and to the textures. */
  val marches = Option.when(config.device.hasEnvironment)(new MarchPort(config))
  val texture = config.device.geometry.texture.map(_ => new TexturePort(config))

  /** To the light cube. */
  val cube = CubePort(config.device)

  /** A pixel of a tile of the environment leaves; no pixel is in flight. */
  val environmentLeaves = Output(Bool())
  val isIdle            = Output(Bool())
  val events            = Output(new PathEvents(config))
}

/** Follows the path of each pixel in flight, one per context: docs/path-tracer.md. Pixels leave in any order; their
  * order depends on timing, their values do not.
  */
final class PathUnit(config: PathConfig) extends Module {
  val io = IO(new PathUnitIO(config))

  private val trace       = io.trace
  private val controller  = Module(new RtController(config)).io
  private val primaryRays = Module(new PrimaryRays(config)).io
  private val raySetup    = Module(RaySetup(config)).io
  private val shader      = Module(Shader(config)).io
  private val shadowRays  = Module(new ShadowRays(config)).io
  private val colourUnit  = Module(new ColourUnit(config)).io
  private val assembler   = Module(new PixelAssembler(config)).io
  private val bounces     = Option.when(config.device.frame.hasBounces)(Module(new BounceScheduler(config)).io)
  private val environment = Option.when(config.device.hasEnvironment)(Module(new EnvironmentPort(config)).io)

  // A gathered ray waits where a ray may leave that is not traced: the light cube accepts one in a cycle
  private val isGathered  = shadowRays.ray.valid && !shadowRays.ray.bits.isShadow
  private val mayLeave    = bounces.map(_.leaves.mayBypass).getOrElse(false.B)
  private val surfaceRays = Wire(chiselTypeOf(shadowRays.ray))
  surfaceRays.bits     := shadowRays.ray.bits
  surfaceRays.valid    := shadowRays.ray.valid && !(isGathered && mayLeave)
  shadowRays.ray.ready := surfaceRays.ready && !(isGathered && mayLeave)

  // From a position to a prepared ray; rays whose pixels are closer to their end have priority
  primaryRays.positions :<>= io.positions
  private val tracedPrimary = environment.map(_.objectRays).getOrElse(primaryRays.ray)
  private val raySources    = trace.visits.toSeq ++ Seq(surfaceRays) ++ bounces.map(_.ray) :+ tracedPrimary
  private val rayArbiter    = Module(new Arbiter(new RayRequest(config), raySources.size)).io
  rayArbiter.in.zip(raySources).foreach { case (in, rays) => in :<>= rays }
  raySetup.request :<>= TimingSlice.queue(rayArbiter.out)              // no path leads from ray set-up to the tiles
  trace.rays :<>= TimingSlice.extra(config.device).queue(raySetup.ray) // nor from the traversal units to it

  // Shading: a lit surface ends its path, after a shadow ray to each light; a mirror or glass continues it
  private val lit = Wire(Valid(new LitSurface(config)))
  shader.request :<>= trace.hits
  trace.hitsReadyNext := shader.readyNext
  shader.lit.ready    := true.B
  lit.valid           := shader.lit.valid
  lit.bits            := shader.lit.bits
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
    environment.hitDistance := trace.surfaceHit.bits.distance.get
    for (bounces <- bounces) environment.bounces.get :<>= bounces.environment.get
    shader.environment.get :<>= environment.surfaces
    io.marches.get :<>= environment.marches
  }

  // From a path to a pixel
  colourUnit.end :<>= controller.end
  colourUnit.surface   := lit
  assembler.allocated  := primaryRays.allocated
  assembler.surfaceHit := trace.surfaceHit
  assembler.colour     := colourUnit.colour
  io.pixels :<>= assembler.pixels
  io.environmentLeaves := assembler.environmentLeaves

  // Gathered rays: their sample points, and the light that they meet
  colourUnit.cube.texel := DontCare
  for (cube <- io.cube; gathers <- controller.gather; registers <- io.registers.gather) {
    val points = Module(new SamplePoints(config)).io
    points.gather             := registers
    points.pixel.valid        := primaryRays.allocated.valid
    points.pixel.bits.context := primaryRays.allocated.bits.context
    points.pixel.bits.pixel.x := primaryRays.allocated.bits.pixel.x
    points.pixel.bits.pixel.y := primaryRays.allocated.bits.pixel.y
    points.count              := gathers.count
    points.port :<>= shader.sample.get
    gathers.bounces := registers.bounces
    gathers.sample  := shader.sample.get.read
    for (bounces <- bounces; path <- bounces.path) {
      gathers.bounced := bounces.in.bits.bounce.context
      path            := gathers.bouncedPath
    }
    val light    = Module(new LightCube(config)).io
    val leaving  = bounces.get.leaves.ray
    val scatters = surfaceRays.fire && isGathered
    light.parallax  := registers.parallax
    light.ray.valid := leaving.valid || scatters
    val ray = Mux(leaving.valid, leaving.bits, surfaceRays.bits)
    light.ray.bits.context                                           := ray.context
    light.ray.bits.origin                                            := ray.origin
    for ((to, from) <- light.ray.bits.dir.axes.zip(ray.dir.axes)) to := Rounding.narrow(from, to.getWidth)
    assert(!(leaving.valid && scatters), "two rays leave in a cycle")
    light.port :<>= colourUnit.cube
    cube :<>= light.memory
  }

  // Control: the state of every context. A path may end in the light cube two cycles after its last ray has left:
  // with many contexts arbitration adds a cycle; with few a slice adds it here
  private val bounced = {
    val now = bounces.map(_.bounced).getOrElse(0.U.asTypeOf(controller.bounced))
    if (io.cube.nonEmpty && !config.isLarge) TimingSlice.valid(now) else now
  }
  controller.allocation :<>= primaryRays.control
  controller.trace :<>= trace.control
  controller.pixel :<>= assembler.control
  controller.shaded.valid                := lit.valid
  controller.shaded.bits.context         := lit.bits.context
  controller.shaded.bits.needsShadowRays := lit.bits.needsShadowRays
  controller.shaded.bits.isOfEnvironment := lit.bits.isOfEnvironment
  controller.bounced                     := bounced
  controller.fetchFailed                 := trace.attributeError
  controller.accumulated.valid           := colourUnit.colour.valid
  controller.accumulated.bits            := colourUnit.colour.bits.context
  controller.continued                   := colourUnit.continued
  bounces.foreach(_.start := primaryRays.start)
  environment.foreach(_.control :<>= controller.environment.get)
  io.isIdle := controller.idleCount === config.contexts.U && assembler.isIdle
  io.events := PathCounters(config, controller, raySetup, trace, shader, shadowRays, bounces)

  // Registers
  private val registers = io.registers
  private val unitShift = registers.frame.unitShift
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
