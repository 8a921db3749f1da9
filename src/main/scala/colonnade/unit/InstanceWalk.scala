package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, Valid}
import colonnade.config.PathConfig
import colonnade.formats.{ObjectInstance, SceneMap}
import colonnade.instance.InstanceFilter
import colonnade.ray.{PreparedRay, RayRequest}
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
