package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, RegEnable, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.PathConfig
import colonnade.formats.{Gather, Shading, Vec3}
import colonnade.numbers.Fixed
import colonnade.ray.RayRequest
import colonnade.shading.{BounceResult, BounceUpdate, BouncedRay, PathEnd}

/** Ports of [[BounceScheduler]] that an environment adds. */
final class DeferredBounceIO(config: PathConfig) extends Bundle {
  val enabled = Input(Bool()) // this frame has an environment

  /** A context whose bounce is deferred until its Fresnel reflection is resolved; a context whose bounce may resume. */
  val fresnelReflection = Valid(Context(config))
  val resume            = Flipped(Decoupled(new ResumedBounce(config)))

  /** The Fresnel reflection, or the ray with which a path continues; whether it may march: the path has not gathered.
    */
  val ray     = Valid(new RayRequest(config))
  val marches = Output(Bool())
}

/** Rays that may meet the light cube. */
final class LeavingRays(config: PathConfig) extends Bundle {

  /** A ray that leaves a mirror or glass, traced or not, or a Fresnel reflection. */
  val ray = Valid(new RayRequest(config))

  /** One that is not traced may leave. */
  val mayBypass = Output(Bool())
}

final class BounceSchedulerIO(config: PathConfig) extends Bundle {
  val shading = Input(new Shading(config.device))
  val start   = Flipped(Valid(Context(config))) // a context gets a new pixel

  /** The path of `in`. */
  val path = Gather(config.device).map(_ => Input(new BouncingPath))

  /** From the shader; to the colour unit and to ray set-up. */
  val in     = Flipped(Decoupled(new BouncedRay(config)))
  val update = Decoupled(new BounceUpdate(config))
  val ray    = Decoupled(new RayRequest(config))

  val bounced      = Valid(new Bounced(config)) // a bounce that is issued
  val isRefraction = Output(Bool())
  val environment  = if (config.device.hasEnvironment) Some(new DeferredBounceIO(config)) else None
  val leaves       = new LeavingRays(config)
}

/** Issues bounces at mirrors and glass. In the same cycle, the colour unit gets the update of the path's throughput,
  * and ray set-up gets the next ray, as long as the path has bounces left.
  *
  * With an environment, the Fresnel reflection of glass is resolved first. It takes the context, and the bounce waits
  * in a table. Bounces from the table have priority; they are issued three cycles after `resume`.
  */
final class BounceScheduler(config: PathConfig) extends Module {
  val io = IO(new BounceSchedulerIO(config))

  private val incoming = Wire(new PendingBounce(config))
  private val result   = io.in.bits.bounce
  for ((isFirst, path) <- incoming.isFirst.zip(io.path)) isFirst := path.isStraight
  incoming.albedo                                                := io.in.bits.albedo
  incoming.isTinted                                              := io.in.bits.isTinted
  incoming.fresnel                                               := result.fresnel
  for (path <- io.path) when(path.isScattered) { incoming.fresnel.raw := 0.U }
  incoming.isRefraction := result.isRefraction
  incoming.origin       := result.origin
  incoming.dir          := result.dir

  // The bounce to issue, of a context
  private val bounce  = Wire(Decoupled(new PendingBounce(config)))
  private val context = WireInit(result.context)
  private val update  = io.update.bits
  bounce.valid      := io.in.valid
  bounce.bits       := incoming
  io.in.ready       := bounce.ready
  update.reflection := PathEnd.background
  io.environment.foreach(deferBounces)

  // Trace its ray as long as the path has bounces left
  private val counts   = Reg(Vec(config.contexts, chiselTypeOf(io.shading.bounces.get)))
  private val isTraced = counts(context) =/= io.shading.bounces.get
  when(bounce.fire && isTraced) { counts(context) := counts(context) + 1.U }
  when(io.start.valid) { counts(io.start.bits) := 0.U }

  bounce.ready             := io.update.ready && (!isTraced || io.ray.ready)
  io.update.valid          := bounce.valid && (!isTraced || io.ray.ready)
  update.context           := context
  update.isFirst           := bounce.bits.isFirst.getOrElse(counts(context) === 0.U)
  update.albedo            := bounce.bits.albedo
  update.isTinted          := bounce.bits.isTinted
  update.fresnel           := bounce.bits.fresnel
  io.ray.valid             := bounce.valid && isTraced && io.update.ready
  io.ray.bits              := rayOf(context, bounce.bits.origin, bounce.bits.dir)
  io.bounced.valid         := bounce.fire
  io.bounced.bits.context  := context
  io.bounced.bits.isTraced := isTraced
  io.bounced.bits.isInside := bounce.bits.isRefraction === bounce.bits.isTinted
  io.isRefraction          := bounce.bits.isRefraction

  // The ray may leave the object
  io.leaves.ray.valid                               := io.bounced.valid
  io.leaves.ray.bits                                := io.ray.bits
  for (environment <- io.environment) io.leaves.ray := environment.ray
  io.leaves.mayBypass                               := (bounce.valid && !isTraced) ||
    io.environment.map(environment => io.in.valid && hasReflection(environment)).getOrElse(false.B)

  /** The bounce from the shader has a Fresnel reflection, which is resolved first. */
  private def hasReflection(environment: DeferredBounceIO): Bool =
    environment.enabled && incoming.fresnel.natural =/= 0.U

  private def deferBounces(environment: DeferredBounceIO): Unit = {
    val bounces    = ContextTable(config, new PendingBounce(config))
    val isDeferred = hasReflection(environment)

    // Read the table, and hold the bounce until it is issued
    val isRead    = RegNext(environment.resume.fire, false.B)
    val isHeld    = RegInit(false.B)
    val resumed   = RegEnable(bounces.read(environment.resume.bits.context, environment.resume.fire), isRead)
    val resumedBy = RegEnable(environment.resume.bits, environment.resume.fire)
    environment.resume.ready := !isRead && !isHeld
    when(isRead) { isHeld := true.B }.elsewhen(bounce.fire) { isHeld := false.B }

    // Write the table
    environment.fresnelReflection.valid := io.in.valid && isDeferred && !bounce.fire
    environment.fresnelReflection.bits  := result.context
    when(environment.fresnelReflection.valid) { bounces.write(result.context, incoming) }

    bounce.valid := isHeld || (io.in.valid && !isDeferred)
    io.in.ready  := Mux(isDeferred, !bounce.fire, bounce.ready && !isHeld)
    when(isHeld) {
      bounce.bits       := resumed
      context           := resumedBy.context
      update.reflection := resumedBy.end
    }

    environment.ray.valid := bounce.fire || environment.fresnelReflection.valid
    environment.marches   := io.path.map(isHeld || !_.isScattered).getOrElse(true.B)
    environment.ray.bits  := rayOf(
      Mux(bounce.fire, context, result.context),
      Mux(bounce.fire, bounce.bits.origin, io.in.bits.fresnelOrigin.get),
      Mux(bounce.fire, bounce.bits.dir, result.reflection)
    )
  }

  private def rayOf(context: UInt, origin: Vec3[SInt], dir: Vec3[SInt]): RayRequest = {
    val ray = Wire(new RayRequest(config))
    ray.leadsThroughWorld()
    ray.context                                             := context
    ray.isShadow                                            := false.B
    for ((to, from) <- ray.origin.axes.zip(origin.axes)) to := Fixed(to.format, from)
    for ((to, from) <- ray.dir.axes.zip(dir.axes)) to       := from
    ray
  }
}

/** A bounce to issue: the update of the path and the next ray, without what is known when it is issued. */
final private class PendingBounce(config: PathConfig) extends Bundle {
  private val (update, result) = (new BounceUpdate(config), new BounceResult(config))

  val isFirst      = Gather(config.device).map(_ => Bool())
  val albedo       = update.albedo.cloneType
  val isTinted     = Bool()
  val fresnel      = update.fresnel.cloneType
  val isRefraction = Bool()
  val origin       = result.origin.cloneType
  val dir          = result.dir.cloneType
}
