package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.common.Context
import colonnade.config.PathConfig
import colonnade.environment.{EnvironmentAccepts, EnvironmentRequest}
import colonnade.formats.Gather
import colonnade.shading.{ContinuedPath, Occlusion, PathEnd, PathTermination, ShadowRequest}

/** The state of a context. */
object ContextState extends ChiselEnum {
  val idle       = Value // it holds no pixel
  val raySetup   = Value // its ray is generated or prepared
  val traversing = Value // its ray visits records
  val resolve    = Value // its trace has ended; the controller has not yet resolved the result
  val shading    = Value // its hit, or its point of the environment, waits for attributes or is in the shader
  val shadowTest = Value // its surface is known; a shadow ray is left to trace

  /** Its ray has missed the object: it waits for the environment march, or is in it. */
  val environmentPending, environmentMarch = Value

  /** Its deferred Fresnel reflection has missed the environment; the bounce waits to resume. */
  val resumeBounce = Value

  /** Its path has ended; its colour waits to be accumulated, or is being accumulated. */
  val accumulatePending, accumulating = Value

  val done = Value // the colour of its pixel is complete
  val lit  = Value // its surface and all shadow rays are known; the path ends, or the surface's bounce resumes

  /** The ray that gathers at its surface waits; the surface's light is added, unless it is of the environment. */
  val gatherPending = Value
}

/** A context whose hit has been shaded. */
final class Shaded(config: PathConfig) extends Bundle {
  val context = Context(config)

  /** By light, for a surface that ends the path. */
  val needsShadowRays = Vec(config.device.frame.lights, Bool())
  val isOfEnvironment = Bool()
}

/** A context whose path continues from a mirror or glass. */
final class Bounced(config: PathConfig) extends Bundle {
  val context = Context(config)

  /** The ray is traced through the object; it is inside glass, where the environment hides nothing. */
  val isTraced = Bool()
  val isInside = Bool()
}

/** A context whose deferred Fresnel reflection is complete, so that its bounce may resume. */
final class ResumedBounce(config: PathConfig) extends Bundle {
  val context = Context(config)
  val end     = PathEnd() // what the reflection shows
}

/** Control of rays that miss the object or whose hit may be hidden, if there may be an environment. */
final class EnvironmentControl(config: PathConfig) extends Bundle {

  /** This frame has an environment; it may hide the object. */
  val enabled   = Input(Bool())
  val occlusion = Input(Bool())

  val bypass = Flipped(Valid(Context(config))) // a primary ray that cannot hit the object

  /** A Fresnel reflection that is resolved first, while its path's bounce is deferred. */
  val fresnelReflection = Flipped(Valid(Context(config)))

  /** A ray to find in the environment, of a kind that is accepted; its result. An occlusion test ends in `hit` or
    * `visible`.
    */
  val req     = Decoupled(new EnvironmentRequest(config))
  val accepts = Input(new EnvironmentAccepts)
  val hit     = Flipped(Valid(Context(config)))
  val miss    = Flipped(Valid(Context(config)))
  val visible = Flipped(Valid(Context(config)))

  val resume = Decoupled(new ResumedBounce(config)) // a deferred bounce that may resume

  /** A context whose point is to be shaded again, after what it has gathered is known; then its `hit` comes. */
  val again = Valid(Context(config))
}

/** Allocation of a context, seen from the stage that gives it a pixel. */
final class AllocationControl(config: PathConfig) extends Bundle {

  /** An idle context, and whether it gets a pixel. */
  val free     = Flipped(Valid(Context(config)))
  val allocate = Output(Bool())
}

/** Control of traces, seen from the stage that traces rays. */
final class TraceControl(config: PathConfig) extends Bundle {
  val entered = Valid(Context(config)) // a prepared ray that enters the object's box

  /** Traces that have ended: the ray misses the box; it has its result. */
  val missesBox = Valid(Context(config))
  val hasResult = Valid(Context(config))

  /** A context whose result is read now, and the one whose result is read in the next cycle. */
  val query     = Flipped(Valid(Context(config)))
  val queryNext = Flipped(Valid(Context(config)))

  /** The ray of `query` has a hit; what it has hit as a shadow ray. */
  val hasHit    = Output(Bool())
  val occlusion = Output(Occlusion())

  /** The ended ray that is resolved has a surface to shade; it is a primary ray. */
  val startsShading = Input(Bool())
  val isPrimary     = Input(Bool())

  /** A context whose hit's distance is read; not in a cycle with `startsShading`. */
  val readsDistance = Flipped(Valid(Context(config)))
}

/** Retirement of pixels, seen from the stage that assembles them. */
final class PixelControl(config: PathConfig) extends Bundle {

  /** A context whose pixel is complete, whether it has an accumulated colour, and whether it retires. */
  val done      = Flipped(Valid(Context(config)))
  val hasColour = Input(Bool())
  val retire    = Output(Bool())
}

/** Control of gathered rays. */
final class GatherControl(config: PathConfig) extends Bundle {
  val bounces = Input(UInt(Gather.countBits.W)) // the register

  /** A context whose sample point is read; in the next cycle, the rays that its path has gathered. */
  val sample = Flipped(Valid(Context(config)))
  val count  = Output(UInt(Gather.countBits.W))

  /** A context at a mirror or glass; what its path is there. */
  val bounced     = Input(Context(config))
  val bouncedPath = Output(new BouncingPath)
}

/** What a path is at a mirror or glass. */
final class BouncingPath extends Bundle {
  val isStraight  = Bool() // its throughput is 1, its radiance 0
  val isScattered = Bool() // it has gathered: there is no Fresnel reflection
}

final class RtControllerIO(config: PathConfig) extends Bundle {
  private def contextCount = Output(UInt(log2Ceil(config.contexts + 1).W))

  val allocation  = Flipped(new AllocationControl(config))
  val trace       = Flipped(new TraceControl(config))
  val shaded      = Flipped(Valid(new Shaded(config)))
  val bounced     = Flipped(Valid(new Bounced(config)))
  val environment = if (config.device.hasEnvironment) Some(new EnvironmentControl(config)) else None

  /** A hit whose attributes have an illegal address: the path ends in the background. */
  val fetchFailed = Flipped(Valid(Context(config)))

  val shadow = Decoupled(new ShadowRequest(config)) // the next shadow ray of a context

  /** A path that has ended, and a context whose colour is complete. */
  val end         = Decoupled(new PathTermination(config))
  val accumulated = Flipped(Valid(Context(config)))
  val continued   = Flipped(Valid(new ContinuedPath(config))) // the light of a surface is added, and its path goes on
  val pixel       = Flipped(new PixelControl(config))
  val gather      = Gather(config.device).map(_ => new GatherControl(config))

  /** Numbers of contexts that are idle, in ray set-up, and waiting for the environment march or in it. */
  val idleCount        = contextCount
  val raySetupCount    = contextCount
  val environmentCount = if (config.device.hasEnvironment) Some(contextCount) else None
}
