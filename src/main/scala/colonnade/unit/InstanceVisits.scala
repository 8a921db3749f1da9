package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, Pipe, Queue, RegEnable, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.PathConfig
import colonnade.formats.{InstanceNumber, ObjectInstance}
import colonnade.instance.{InstanceTransform, ObjectScale}
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.{PreparedRay, RayFormats, SequentialRaySetup, TriangleRay}

/** A context whose ray is to be traced in an instance; hits before `tMax` count, along the ray of the world. */
final class InstanceStep(config: PathConfig) extends Bundle {
  val context  = Context(config)
  val instance = InstanceNumber(config.device).get
  val tMax     = new Fixed(new RayFormats(config.numbers).grid)
}

/** A ray in the axes of an object, whose cube it enters or misses. */
final class VisitedRay(config: PathConfig) extends Bundle {
  val visit    = new InstanceStep(config)
  val enters   = Bool()
  val isShadow = Bool()
  val tEntry   = new Fixed(new RayFormats(config.numbers).entry)
  val scale    = new ObjectScale(config.numbers)
}

final class InstanceVisitsIO(config: PathConfig) extends Bundle {
  val instances = Input(Vec(config.device.frame.instances, new ObjectInstance(config.device)))

  /** Rays of the world, for their first instance; contexts for another one. */
  val rays  = Flipped(Decoupled(new PreparedRay(config)))
  val again = Flipped(Valid(new InstanceStep(config)))

  /** To the traversal units those that enter; all for who waits for results, in the cycle in which they leave. */
  val objectRays = Decoupled(new PreparedRay(config))
  val visited    = Valid(new VisitedRay(config))
}

/** Transforms rays of the world to the axes of objects, and prepares them there. */
final class InstanceVisits(config: PathConfig) extends Module {
  private val numbers = config.numbers

  val io = IO(new InstanceVisitsIO(config))

  // The rays of the world, their next visits, and the contexts that wait for them. A visit has one writer: a ray that is on
  // its way goes before a new one
  private val ray     = io.rays.bits
  private val worlds  = ContextTable(config, new WorldRay(config))
  private val steps   = ContextTable(config, new InstanceStep(config))
  private val waiting = new WaitingContexts(config)
  private val again   = Pipe(io.again)
  private val world   = Wire(new WorldRay(config))
  private val first   = Wire(new InstanceStep(config))
  private val next    = Mux(again.valid, again.bits, first)
  world.isShadow := ray.isShadow
  world.ray      := ray.ray.forTriangles
  first.context  := ray.context
  first.instance := 0.U
  first.tMax     := ray.tMax
  io.rays.ready  := !again.valid
  when(io.rays.fire) { worlds.write(ray.context, world) }
  when(io.rays.valid || again.valid) { steps.write(next.context, next) }
  waiting.enter(io.rays.valid || again.valid, next.context)

  // The tables are read in one cycle, and the ray enters the transform in the next
  private val transform = Module(new InstanceTransform(config)).io
  private val isRead    = RegInit(false.B)
  private val starts    = transform.visit.ready && !isRead && waiting.next.valid
  private val step      = steps.read(waiting.next.bits, starts)
  private val started   = worlds.read(waiting.next.bits, starts)
  private val visit     = RegEnable(step, isRead)
  waiting.take(starts)
  isRead                        := starts
  transform.visit.valid         := isRead
  transform.visit.bits.context  := step.context
  transform.visit.bits.tMax     := step.tMax
  transform.visit.bits.isShadow := started.isShadow
  transform.visit.bits.ray      := started.ray
  transform.instance            := io.instances(visit.instance)

  // Set-up, as slow as the transform; meanwhile what else is known of the ray waits in a queue
  private val setup = Module(new SequentialRaySetup(config)).io
  private val tags  = Module(new Queue(new SetupTag(config), InstanceVisits.inSetup)).io
  setup.request.valid := transform.ray.valid && tags.enq.ready
  setup.request.bits  := transform.ray.bits.request
  transform.ray.ready := setup.request.ready && tags.enq.ready
  tags.enq.valid      := setup.request.fire
  tags.enq.bits.visit := visit
  tags.enq.bits.scale := transform.ray.bits.scale
  tags.enq.bits.limit := transform.ray.bits.limit
  setup.bounds.low.axes.foreach(_ := 0.U)
  setup.bounds.high.axes.foreach(_ := ((BigInt(1) << numbers.vertexBits) - 1).U)

  // To a traversal unit, with what is left of the limit at the entry
  private val prepared = setup.ray.bits
  private val known    = tags.deq.bits
  private val left     = known.limit.zext -& Rounding.floor(prepared.tEntry.natural, -numbers.gridFraction).zext
  private val most     = (BigInt(1) << (numbers.gridBits - 1)) - 1
  io.objectRays.valid     := setup.ray.valid && prepared.enters
  io.objectRays.bits      := prepared
  io.objectRays.bits.tMax := Fixed(new RayFormats(numbers).grid, Rounding.saturate(left, BigInt(0), most))
  io.objectRays.bits.root.foreach(_ := io.instances(known.visit.instance).root)
  setup.ray.ready          := !prepared.enters || io.objectRays.ready
  tags.deq.ready           := setup.ray.fire
  io.visited.valid         := setup.ray.fire
  io.visited.bits.visit    := known.visit
  io.visited.bits.enters   := prepared.enters
  io.visited.bits.isShadow := prepared.isShadow
  io.visited.bits.tEntry   := prepared.tEntry
  io.visited.bits.scale    := known.scale
}

private object InstanceVisits {

  /** Rays in sequential set-up, and one that waits. */
  val inSetup: Int = 4
}

/** What the transform reads of a ray. */
final private class WorldRay(config: PathConfig) extends Bundle {
  val isShadow = Bool()
  val ray      = new TriangleRay(config.numbers)
}

/** What is known of a ray in set-up. */
final private class SetupTag(config: PathConfig) extends Bundle {
  val visit = new InstanceStep(config)
  val scale = new ObjectScale(config.numbers)
  val limit = UInt((config.numbers.sceneBits + 1).W)
}
