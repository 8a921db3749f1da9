package colonnade.unit

import chisel3._
import chisel3.util.Decoupled
import colonnade.config.PathConfig
import colonnade.environment.{EnvironmentRays, HitDistance, MarchFormats, MarchPort}
import colonnade.formats.{EnvironmentView, PixelPosition}
import colonnade.numbers.Normalise
import colonnade.ray.RayRequest
import colonnade.shading.EnvironmentSurface

final class EnvironmentPortIO(config: PathConfig) extends Bundle {
  val view    = Input(new EnvironmentView(config.numbers))
  val control = Flipped(new EnvironmentControl(config))

  /** Primary rays, their pixels, and whether they may hit the object; rays that may. */
  val primary     = Flipped(Decoupled(new RayRequest(config)))
  val pixel       = Input(new PixelPosition(config.device))
  val meetsObject = Input(Bool())
  val objectRays  = Decoupled(new RayRequest(config))
  val bounces     = if (config.device.frame.hasBounces) Some(Flipped(new DeferredBounceIO(config))) else None

  /** In the cycle after an occlusion test's `control.req`: the distance of its hit. */
  val hitDistance = Input(HitDistance(config))

  /** Points of the environment to shade. */
  val surfaces = Decoupled(new EnvironmentSurface(config))

  val marches = new MarchPort(config)
}

/** Routes rays to the marches of the environment: every ray that may miss the object is stored. A primary ray that
  * cannot hit the object bypasses ray set-up. The ray of a hit that the environment may hide is marched too.
  */
final class EnvironmentPort(config: PathConfig) extends Module {
  val io = IO(new EnvironmentPortIO(config))

  private val stage   = Module(new EnvironmentRays(config)).io
  private val control = io.control
  control.enabled   := io.view.enabled
  control.occlusion := io.view.occlusion
  stage.isMapCamera := io.view.isMapCamera
  io.marches :<>= stage.marches

  // March
  stage.req :<>= control.req
  stage.again       := control.again
  control.accepts   := stage.accepts
  control.miss      := stage.miss
  control.visible   := stage.visible
  stage.hitDistance := io.hitDistance
  io.surfaces :<>= stage.surface
  control.hit.valid := stage.surface.fire
  control.hit.bits  := stage.surface.bits.context

  // Deferred bounces
  control.fresnelReflection := 0.U.asTypeOf(control.fresnelReflection)
  control.resume.ready      := false.B
  for (bounces <- io.bounces) {
    bounces.enabled           := io.view.enabled
    control.fresnelReflection := bounces.fresnelReflection
    bounces.resume :<>= control.resume
  }

  // Store rays, if they may march; bounces have priority. A path that has gathered stores none, for the table
  // still has the point of the environment at which it may have begun
  private val primary   = io.primary.bits
  private val bounceRay = io.bounces.map(_.ray)
  private val isBounce  = bounceRay.map(_.valid).getOrElse(false.B)
  private val ray       = bounceRay.fold(primary)(bounce => Mux(bounce.valid, bounce.bits, primary))
  private val dir       = Normalise.together(ray.dir.axes, new MarchFormats(config.device).f)
  private val isStored  = io.bounces.map(bounces => isBounce && bounces.marches).getOrElse(false.B)
  stage.ray.valid           := io.view.enabled && (isStored || io.primary.fire)
  stage.ray.bits.context    := ray.context
  stage.ray.bits.ray.origin := ray.origin
  stage.ray.bits.ray.dir.axes.zip(dir).foreach { case (to, from) => to := from }
  stage.ray.bits.ray.pixel := io.pixel

  // Trace primary rays that may hit the object
  io.objectRays.valid  := io.primary.valid && !isBounce && io.meetsObject
  io.objectRays.bits   := primary
  io.primary.ready     := !isBounce && (io.objectRays.ready || !io.meetsObject)
  control.bypass.valid := io.primary.fire && !io.meetsObject
  control.bypass.bits  := primary.context
}
