package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, OHToUInt, PriorityEncoderOH, Valid}
import colonnade.common.{Context, ContextTable, ReservedQueue}
import colonnade.config.PathConfig
import colonnade.formats.{InstanceNumber, ObjectInstance}
import colonnade.instance.{InstanceTransform, ObjectScale}
import colonnade.numbers.Fixed
import colonnade.ray.{RayFormats, RayRequest, TriangleRay}
import colonnade.shading.Occlusion

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

/** Transforms rays of the world to the axes of objects: a visit every three cycles. */
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

  // Ray and step are read in the cycle before a visit enters the transform
  private val transform = Module(new InstanceTransform(config)).io
  private val reads     = waiting.out.fire
  private val context   = waiting.out.bits
  private val readStep  = steps.read(context, reads)
  waiting.mayTakeNext           := true.B
  waiting.out.ready             := transform.readyNext
  io.rays.context.valid         := reads
  io.rays.context.bits          := context
  transform.instances           := io.instances
  transform.visit.valid         := RegNext(reads, false.B)
  transform.visit.bits.context  := RegNext(context)
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
