package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, OHToUInt, PriorityEncoderOH, Valid}
import colonnade.common.{Context, ContextTable, ReservedQueue}
import colonnade.config.PathConfig
import colonnade.formats.{InstanceNumber, ObjectInstance, SceneMap}
import colonnade.instance.{InstanceFilter, InstanceTransform, ObjectScale}
import colonnade.numbers.Fixed
import colonnade.ray.{PreparedRay, RayFormats, RayRequest, TriangleRay}
import colonnade.shading.Occlusion

final class InstanceWalkIO(config: PathConfig) extends Bundle {
  val scene     = Input(new SceneMap(config.device))
  val instances = Input(Vec(config.device.frame.instances, new ObjectInstance(config.device)))

  /** From ray set-up: rays of the world that enter the box of all objects, and rays in the axes of objects. */
  val rays = Flipped(Decoupled(new PreparedRay(config)))

  /** Rays of the world as their visits read them. */
  val worldRays = new WorldRayRead(config)

  /** To ray set-up: rays in the axes of objects. */
  val requests = Decoupled(new RayRequest(config))

  /** What the rays of the world have met. */
  val results = Valid(new TraceResult(config))

  /** To the traversal units; what rays have met there. */
  val objectRays    = Decoupled(new PreparedRay(config))
  val objectResults = Flipped(Valid(new TraceResult(config)))
}

/** Traces rays in one instance after the other whose box they enter, and returns the nearest hits: docs/path-tracer.md,
  * instances. Without instances rays go to the tree of the scene as they are.
  */
final class InstanceWalk(config: PathConfig) extends Module {
  val io = IO(new InstanceWalkIO(config))

  private val isOff   = io.scene.instances.get === 0.U
  private val filter  = Module(new InstanceFilter(config)).io
  private val visits  = Module(new InstanceVisits(config)).io
  private val results = Module(new InstanceResults(config)).io

  // Rays in objects go to the traversal units if they enter, rays of the world to the filter
  private val ray     = io.rays.bits
  private val visit   = ray.visit.get
  private val isWorld = !visit.valid && !isOff
  private val misses  = visit.valid && !ray.enters
  filter.ray.valid        := io.rays.valid && isWorld
  filter.ray.bits         := ray
  filter.count            := io.scene.instances.get
  filter.boxes            := VecInit(io.instances.map(_.box))
  results.misses(1).valid := io.rays.valid && misses
  results.misses(1).bits  := ray.context
  io.objectRays.valid     := io.rays.valid && !isWorld && !misses
  io.objectRays.bits      := ray
  io.objectRays.bits.root.foreach(_ := Mux(isOff, io.scene.root, io.instances(visit.bits).root))
  io.rays.ready         := Mux(isWorld, filter.ray.ready, Mux(misses, results.misses(1).ready, io.objectRays.ready))
  results.entries.valid := io.objectRays.fire
  results.entries.bits.context := ray.context
  results.entries.bits.tEntry  := ray.tEntry

  // Steps: a ray that goes on before a new one, which ends at once if it enters no box
  private val step    = results.steps
  private val entered = filter.entered.bits
  private val isNoBox = entered.mask === 0.U
  private val isTaken = !results.again.valid && (!isNoBox || results.misses(0).ready)
  filter.entered.ready    := isTaken
  results.misses(0).valid := filter.entered.valid && isNoBox && !results.again.valid
  results.misses(0).bits  := entered.context
  step.valid              := results.again.valid || filter.entered.fire
  step.bits               := results.again.bits
  when(!results.again.valid) {
    step.bits.context   := entered.context
    step.bits.isShadow  := entered.isShadow
    step.bits.left      := entered.mask
    step.bits.tMax      := entered.tMax
    step.bits.hasHit    := false.B
    step.bits.occlusion := Occlusion.none
  }
  visits.instances   := io.instances
  visits.steps       := step
  visits.steps.valid := step.valid && step.bits.left =/= 0.U
  results.scales     := visits.scales
  io.worldRays :<>= visits.rays
  io.requests :<>= visits.requests

  results.objectResults       := io.objectResults
  results.objectResults.valid := io.objectResults.valid && !isOff
  io.results                  := results.results
  when(isOff) {
    io.results := io.objectResults
    for (visit <- io.results.bits.visit) {
      visit.instance := 0.U
      visit.isNearer := io.objectResults.bits.hasHit
      visit.isLast   := true.B
    }
  }
}

/** A ray of the world that is yet to be traced in some instances, or in none: what it has met before. */
class RayProgress(config: PathConfig) extends Bundle {
  val isShadow = Bool()

  /** A bit for each instance; the lowest one is next. */
  val left = UInt(config.device.frame.instances.W)

  /** The nearest hit's distance, or the ray's limit: only hits before count. */
  val tMax      = new Fixed(new RayFormats(config.numbers).grid)
  val hasHit    = Bool()
  val occlusion = Occlusion()

  /** The next instance, as a bit. */
  def next: UInt = PriorityEncoderOH(left)
}

/** The progress of a context's ray. */
final class InstanceStep(config: PathConfig) extends RayProgress(config) {
  val context = Context(config)

  def progress: RayProgress = {
    val progress = Wire(new RayProgress(config))
    progress.isShadow  := isShadow
    progress.left      := left
    progress.tMax      := tMax
    progress.hasHit    := hasHit
    progress.occlusion := occlusion
    progress
  }
}

/** Reads a context's ray of the world: it comes in the cycle after the read. */
final class WorldRayRead(config: PathConfig) extends Bundle {
  val context = Valid(Context(config))
  val ray     = Input(new TriangleRay(config.numbers))
}

/** The scale of the ray that a context has in the axes of its next object. */
final class VisitScale(config: PathConfig) extends Bundle {
  val context = Context(config)
  val scale   = new ObjectScale(config.numbers)
}

final class InstanceVisitsIO(config: PathConfig) extends Bundle {
  val instances = Input(Vec(config.device.frame.instances, new ObjectInstance(config.device)))

  /** Contexts with an instance that is left, and their rays of the world. */
  val steps = Flipped(Valid(new InstanceStep(config)))
  val rays  = new WorldRayRead(config)

  /** In the axes of objects, to ray set-up. */
  val requests = Decoupled(new RayRequest(config))
  val scales   = Valid(new VisitScale(config))
}

/** Transforms rays of the world to the axes of objects: a visit a cycle. */
final class InstanceVisits(config: PathConfig) extends Module {
  val io = IO(new InstanceVisitsIO(config))

  private val steps   = ContextTable(config, new PendingVisit(config))
  private val waiting = Module(new ReservedQueue(Context(config), config.contexts.max(2))).io
  private val step    = Wire(new PendingVisit(config))
  step.isShadow := io.steps.bits.isShadow
  step.instance := OHToUInt(io.steps.bits.next)
  step.tMax     := io.steps.bits.tMax
  when(io.steps.valid) { steps.write(io.steps.bits.context, step) }
  waiting.in.valid := io.steps.valid
  waiting.in.bits  := io.steps.bits.context

  // Ray and step are read in the cycle before a visit is offered to the transform, and again while it is not taken
  private val transform = Module(new InstanceTransform(config)).io
  private val offers    = RegInit(false.B)
  private val isTaken   = !offers || transform.visit.ready
  private val reads     = waiting.out.fire || !isTaken
  private val offered   = Reg(Context(config))
  private val context   = Mux(isTaken, waiting.out.bits, offered)
  private val readStep  = steps.read(context, reads)
  offers                        := reads
  offered                       := context
  waiting.mayTakeNext           := true.B
  waiting.out.ready             := isTaken
  io.rays.context.valid         := reads
  io.rays.context.bits          := context
  transform.instances           := io.instances
  transform.visit.valid         := offers
  transform.visit.bits.context  := offered
  transform.visit.bits.isShadow := readStep.isShadow
  transform.visit.bits.ray      := io.rays.ray
  transform.visit.bits.instance := readStep.instance
  transform.visit.bits.tMax     := readStep.tMax

  transform.ray.ready    := io.requests.ready
  io.requests.valid      := transform.ray.valid
  io.requests.bits       := transform.ray.bits.request
  io.scales.valid        := io.requests.fire
  io.scales.bits.context := io.requests.bits.context
  io.scales.bits.scale   := transform.ray.bits.scale
}

/** What the transform needs of a step. */
final private class PendingVisit(config: PathConfig) extends Bundle {
  val isShadow = Bool()
  val instance = InstanceNumber(config.device).get
  val tMax     = new Fixed(new RayFormats(config.numbers).grid)
}
