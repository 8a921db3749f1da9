package colonnade.unit

import chisel3._
import chisel3.experimental.hierarchy.{instantiable, public}
import chisel3.util.{log2Ceil, Decoupled, Queue, RegEnable, Valid}
import colonnade.common.{Context, First}
import colonnade.config.{PathConfig, TraversalConfig}
import colonnade.formats.{RecordBroadcast, RecordRequest, SceneMap}
import colonnade.ray.PreparedRay
import colonnade.traversal.TriangleLanesIO

/** Events of a [[TraversalUnit]] in one cycle. */
final class TraversalEvents(config: TraversalConfig) extends Bundle {
  val intersector = new IntersectorEvents(config)
  val fetch       = new FetchEvents(config)
}

/** `scene` is constant while a frame runs; `start` precedes the first ray. */
final class TraversalUnitIO(config: TraversalConfig) extends Bundle {
  val row        = Input(UInt(log2Ceil(config.device.recordRequesters).W))
  val scene      = Input(new SceneMap(config.device))
  val start      = Input(Bool())
  val requests   = Decoupled(new RecordRequest(config.device))
  val broadcasts = Flipped(Vec(config.device.columnBvhMemory.banks, Valid(new RecordBroadcast(config.device))))

  /** A ray that enters the object's box, with the context of its path; only in a cycle with `isFree`. */
  val rays   = Flipped(Valid(new PreparedRay(PathConfig(config.device))))
  val isFree = Output(Bool())

  /** To the triangle units of the group of rows; a record waits for one. */
  val triangleLanes     = Flipped(new TriangleLanesIO(config))
  val waitsForTriangles = Output(Bool())

  /** In any order. */
  val results = Decoupled(new TraceResult(PathConfig(config.device)))
  val events  = Output(new TraversalEvents(config))
}

/** Traces rays for a path unit. A ray takes an idle context, and leaves it when its result enters the queue of one
  * result. The context that ended and has the lowest number goes first; a result every other cycle. There are only as
  * many rays as contexts, and each one ends, so a unit becomes free as long as `results` are taken.
  */
@instantiable
final class TraversalUnit(config: TraversalConfig) extends Module {
  @public val io: TraversalUnitIO = IO(new TraversalUnitIO(config))

  private val contexts    = config.contexts
  private val fetch       = Module(new FetchStage(config)).io
  private val intersector = Module(new Intersector(config)).io

  private val isUsed   = RegInit(VecInit.fill(contexts)(false.B))
  private val hasEnded = RegInit(VecInit.fill(contexts)(false.B))
  private val isShadow = Reg(Vec(contexts, Bool()))

  /** The context of the path whose ray a context traces. */
  private val owners = Reg(Vec(contexts, Context(PathConfig(config.device))))

  // Allocate a context
  private val free = First(isUsed.map(!_)).bits
  private val ray  = Wire(Valid(new PreparedRay(config)))
  ray              := io.rays
  ray.bits.context := free
  io.isFree        := !isUsed.asUInt.andR
  when(io.rays.valid) {
    isUsed(free)   := true.B
    owners(free)   := io.rays.bits.context
    isShadow(free) := io.rays.bits.isShadow
  }
  assert(!io.rays.valid || io.isFree, "a ray comes to a traversal unit without an idle context")

  // Trace
  io.requests :<>= fetch.requests
  fetch.broadcasts         := io.broadcasts
  fetch.ray                := ray
  fetch.fetches            := intersector.fetches
  fetch.nodesReadyNext     := intersector.nodesReadyNext
  fetch.trianglesReadyNext := intersector.trianglesReadyNext
  fetch.start              := io.start
  fetch.row                := io.row
  fetch.scene              := io.scene
  intersector.rays         := ray
  intersector.isShadow     := isShadow
  intersector.fetchError   := fetch.error
  intersector.start        := io.start
  intersector.scene        := io.scene
  intersector.nodes :<>= fetch.nodes
  intersector.triangles :<>= fetch.triangles
  intersector.triangleLanes :<>= io.triangleLanes
  io.waitsForTriangles := fetch.waitsForTriangles
  intersector.ended.foreach(ended => when(ended.valid) { hasEnded(ended.bits) := true.B })

  // Results: the hit's details are read in one cycle, and the result leaves in the next
  private val result = Wire(Decoupled(new TraceResult(PathConfig(config.device))))
  private val queue  = Module(new Queue(new TraceResult(PathConfig(config.device)), 1))
  private val ended  = First(hasEnded).bits
  private val reads  = hasEnded.asUInt.orR && queue.io.enq.ready && !result.valid
  private val reader = RegEnable(ended, reads)
  when(reads) { hasEnded(ended) := false.B }
  when(result.valid) { isUsed(reader) := false.B }
  intersector.outcome.context.valid := reads
  intersector.outcome.context.bits  := ended
  result.valid                      := RegNext(reads, false.B)
  result.bits.context               := owners(reader)
  result.bits.hasHit                := intersector.outcome.hasHit
  result.bits.occlusion             := intersector.outcome.occlusion
  result.bits.hit                   := intersector.outcome.hit
  result.bits.isClear.zip(intersector.outcome.isClear).foreach { case (to, from) => to := from }
  result.bits.visit.foreach(_ := DontCare)
  queue.io.enq :<>= result
  io.results :<>= queue.io.deq

  io.events.intersector := intersector.events
  io.events.fetch       := fetch.events
}
