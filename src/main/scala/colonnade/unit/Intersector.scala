package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, Arbiter, Decoupled, DecoupledIO, Pipe, Valid}
import colonnade.common.{Context, TimingSlice}
import colonnade.config.TraversalConfig
import colonnade.formats.{NodeRecord, SceneMap}
import colonnade.ray.PreparedRay
import colonnade.traversal.{NodeRef, TriangleCandidate, TriangleLanesIO, TriangleResult}

/** Events of [[Intersector]]; names as in `Counters`. */
final class IntersectorEvents(config: TraversalConfig) extends Bundle {
  private def contextCount = UInt(log2Ceil(config.contexts + 1).W)

  val raysInBox         = Bool()
  val nodeReads         = Bool()
  val boxTests          = UInt(log2Ceil(NodeRecord.most + 1).W)
  val triangleTests     = Bool()
  val busyBoxUnit       = Bool()
  val busyTriangleUnit  = UInt(log2Ceil(config.device.units.triangleLanes + 1).W)
  val contextsBox       = contextCount
  val contextsTriangles = contextCount
  val deepestStack      = UInt(log2Ceil(config.device.columnBvhMemory.stackDepth + 1).W)
  val stackOverflow     = Bool()
  val illegalRecord     = Bool()
}

final class IntersectorIO(config: TraversalConfig) extends Bundle {
  val start = Input(Bool()) // a frame starts
  val scene = Input(new SceneMap(config.device))

  /** A ray that enters the object's box, for an idle context; by context: its ray is a shadow ray. */
  val rays     = Flipped(Valid(new PreparedRay(config)))
  val isShadow = Input(Vec(config.contexts, Bool()))

  /** Traces that have ended: no record is left to visit, or the shadow ray is occluded. */
  val ended   = Output(Vec(2, Valid(Context(config))))
  val outcome = Flipped(new HitReader(config))

  /** Fetches of the first record and of the next record. */
  val fetches    = Output(Vec(2, Valid(new FetchRequest(config))))
  val nodes      = Flipped(Decoupled(new NodeCandidate(config)))
  val triangles  = Flipped(Decoupled(new TriangleCandidate(config)))
  val fetchError = Flipped(Valid(Context(config)))

  /** To the triangle units of the group of rows. */
  val triangleLanes = Flipped(new TriangleLanesIO(config))

  /** `nodes` and `triangles` are ready in the next cycle. */
  val nodesReadyNext     = Output(Bool())
  val trianglesReadyNext = Output(Bool())
  val events             = Output(new IntersectorEvents(config))
}

/** Intersects rays with the scene: BVH traversal, triangle tests, closest hits, and early termination of shadow rays.
  *
  * A ray requests its next record as soon as the current one is tested. A shadow ray ends at its first opaque hit.
  */
final class Intersector(config: TraversalConfig) extends Module {
  val io = IO(new IntersectorIO(config))

  private val traversal = Module(new Traversal(config))
  private val triangles = io.triangleLanes
  private val hitTable  = Module(new HitTable(config))

  // Start a trace
  private val ray = io.rays.bits
  drive(traversal.io.start, io.rays.valid, ray.context)
  hitTable.io.start.valid        := io.rays.valid
  hitTable.io.start.bits.context := ray.context
  hitTable.io.start.bits.tMax    := ray.tMax
  fetch(io.fetches(0), io.rays.valid, ray.context, Traversal.root(config, ray, io.scene))

  // Traverse the BVH
  private val step = traversal.io.steps
  traversal.io.clear := io.start
  traversal.io.scene := io.scene
  hitTable.io.tMax.zip(traversal.io.tMax).foreach { case (table, reader) => table :<>= reader }
  traversal.io.nodes :<>= io.nodes
  step.ready := true.B
  drive(io.ended(0), step.fire && step.bits.isDone, step.bits.context)
  fetch(io.fetches(1), step.fire && !step.bits.isDone, step.bits.context, step.bits.target)

  // Test triangles: a result terminates an occluded shadow ray, or the ray resumes after its record.
  // The termination is registered, so that no path leads from the triangle units through the hit table to the results
  private val slice      = TimingSlice.extra(config.device)
  private val result     = if (slice.isEnabled) compared(slice.queue(triangles.result)) else triangles.result
  private val isShadow   = slice(io.isShadow(result.bits.context))
  private val isOccluded = isShadow && hitTable.io.hasHitNow
  private val resumes    = Module(new Arbiter(Context(config), 2))
  triangles.candidate :<>= io.triangles
  hitTable.io.result.valid := result.fire
  hitTable.io.result.bits  := result.bits
  if (ray.limits.nonEmpty) {
    val limits = Module(new HitLimits(config)).io
    limits.rays                   := io.rays
    limits.result                 := result.bits
    hitTable.io.result.bits.isHit := limits.isHit
  }
  hitTable.io.isShadow := isShadow
  result.ready         := isOccluded || !result.bits.isLast || resumes.io.in(1).ready
  io.ended(1)          := Pipe(result.fire && result.bits.isLast && isOccluded, result.bits.context)
  hitTable.io.outcome :<>= io.outcome

  // A record with an illegal address is skipped
  private val skipped = TimingSlice.valid(io.fetchError)
  resumes.io.in(0).valid := skipped.valid
  resumes.io.in(0).bits  := skipped.bits
  resumes.io.in(1).valid := result.valid && result.bits.isLast && !isOccluded
  resumes.io.in(1).bits  := result.bits.context
  traversal.io.resume :<>= resumes.io.out

  io.nodesReadyNext     := traversal.io.readyNext
  io.trianglesReadyNext := triangles.readyNext

  io.events.raysInBox         := io.rays.valid
  io.events.nodeReads         := io.nodes.fire
  io.events.boxTests          := traversal.io.boxTests
  io.events.triangleTests     := result.fire
  io.events.busyBoxUnit       := traversal.io.busy
  io.events.busyTriangleUnit  := triangles.busy
  io.events.contextsBox       := Occupancy(config, Seq(io.nodes.fire, traversal.io.resume.fire), Seq(step.fire))
  io.events.contextsTriangles := Occupancy(config, Seq(io.triangles.fire), Seq(result.fire && result.bits.isLast))
  io.events.deepestStack      := traversal.io.deepest
  io.events.stackOverflow     := traversal.io.overflow
  io.events.illegalRecord     := traversal.io.illegal

  /** A result stays a cycle while the hit table compares it. */
  private def compared(offered: DecoupledIO[TriangleResult]): DecoupledIO[TriangleResult] = {
    val result     = Wire(Decoupled(new TriangleResult(config)))
    val isCompared = RegInit(false.B)
    isCompared    := offered.valid && !offered.fire
    result.valid  := offered.valid && isCompared
    result.bits   := offered.bits
    offered.ready := result.ready && isCompared
    result
  }

  private def drive(port: Valid[UInt], valid: Bool, context: UInt): Unit = {
    port.valid := valid
    port.bits  := context
  }

  private def fetch(port: Valid[FetchRequest], valid: Bool, context: UInt, target: NodeRef): Unit = {
    port.valid        := valid
    port.bits.context := context
    port.bits.kind    := Mux(target.isLeaf, RecordKind.leaf, RecordKind.node)
    port.bits.address := target.address
  }
}
