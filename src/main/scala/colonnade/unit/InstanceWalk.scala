package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, Valid}
import colonnade.config.PathConfig
import colonnade.formats.{ObjectInstance, SceneMap}
import colonnade.ray.PreparedRay

final class InstanceWalkIO(config: PathConfig) extends Bundle {
  val scene     = Input(new SceneMap(config.device))
  val instances = Input(Vec(config.device.frame.instances, new ObjectInstance(config.device)))

  /** Rays of the world that enter the box of all objects; what they have met. */
  val rays    = Flipped(Decoupled(new PreparedRay(config)))
  val results = Valid(new TraceResult(config))

  /** The same rays in the axes of objects, to the traversal units; what they have met there. */
  val objectRays    = Decoupled(new PreparedRay(config))
  val objectResults = Flipped(Valid(new TraceResult(config)))
}

/** Traces rays in one instance after the other, and returns the nearest hits: docs/path-tracer.md, instances. Without
  * instances rays go to the tree of the scene as they are.
  */
final class InstanceWalk(config: PathConfig) extends Module {
  val io = IO(new InstanceWalkIO(config))

  private val count   = io.scene.instances.get
  private val isOff   = count === 0.U
  private val visits  = Module(new InstanceVisits(config)).io
  private val results = Module(new InstanceResults(config)).io

  visits.instances      := io.instances
  visits.rays.valid     := io.rays.valid && !isOff
  visits.rays.bits      := io.rays.bits
  visits.again          := results.again
  results.count         := count
  results.visited       := visits.visited
  results.objectResults := io.objectResults
  when(isOff) { results.objectResults.valid := false.B }

  io.rays.ready           := Mux(isOff, io.objectRays.ready, visits.rays.ready)
  visits.objectRays.ready := io.objectRays.ready && !isOff
  io.objectRays.valid     := Mux(isOff, io.rays.valid, visits.objectRays.valid)
  io.objectRays.bits      := visits.objectRays.bits
  io.results              := results.results
  when(isOff) {
    io.objectRays.bits := io.rays.bits
    io.objectRays.bits.root.foreach(_ := io.scene.root)
    io.results := io.objectResults
  }
}
