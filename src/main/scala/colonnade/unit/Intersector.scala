package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, Arbiter, Decoupled, DecoupledIO, Pipe, Queue, RegEnable, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.ColonnadeConfig
import colonnade.environment.HitDistance
import colonnade.formats.{RecordFormats, SceneMap}
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.{PreparedRay, RayFormats}
import colonnade.traversal.{NodeRef, TriangleCandidate, TriangleLanes, TriangleLanesIO, TriangleResult}

/** The closest hit of a ray that is to be shaded. */
final class SurfaceHit(config: ColonnadeConfig) extends Bundle {
  val context   = Context(config)
  val isPrimary = Bool()

  /** Packed triangle id. */
  val id = UInt(RecordFormats.idBits(config).W)
  val t  = new Fixed(new RayFormats(config.numbers).grid)

  /** From the ray's origin along its dominant axis. */
  val distance = if (SurfaceHit.hasDistance(config)) Some(HitDistance(config)) else None
}

object SurfaceHit {

  /** A traversal unit leaves distances to its path unit. */
  def hasDistance(config: ColonnadeConfig): Boolean =
    !config.hasPathUnit && (config.frame.hits || config.hasEnvironment)

  /** The distance of a hit at `t` of a ray that enters the object's box at `tEntry`, in whole units. */
  def distance(config: ColonnadeConfig, tEntry: UInt, t: Fixed): UInt =
    Rounding.floor(tEntry, -config.numbers.gridFraction) +& t.integer.asUInt

  /** The record with the attributes of a triangle. */
  def attributeAddress(config: ColonnadeConfig, scene: SceneMap, id: UInt): UInt = {
    val slotBits = RecordFormats.faceSlotBits(config)
    // With one face per record the sum may be too large: all ones is no legal address
    if (slotBits == 0) Rounding.saturate(scene.attributeBase +& id, id.getWidth)
    else scene.attributeBase + (id >> slotBits)
  }
}

/** Events of [[Intersector]]; names as in `UnitEvents`. */
final class IntersectorEvents(config: ColonnadeConfig) extends Bundle {
  private def contextCount = UInt(log2Ceil(config.array.contexts + 1).W)

  val raysInBox         = Bool()
  val nodeReads         = Bool()
  val boxTests          = UInt(log2Ceil(config.geometry.arity + 1).W)
  val triangleTests     = Bool()
  val busyBoxUnit       = Bool()
  val busyTriangleUnit  = UInt(log2Ceil(config.units.triangleLanes + 1).W)
  val contextsBox       = contextCount
  val contextsTriangles = contextCount
  val deepestStack      = UInt(log2Ceil(config.columnBvhMemory.stackDepth + 1).W)
  val stackOverflow     = Bool()
  val illegalRecord     = Bool()
}

/** Ports of [[Intersector]]. */
final class IntersectorIO(config: ColonnadeConfig) extends Bundle {

  /** A frame starts. */
  val start   = Input(Bool())
  val scene   = Input(new SceneMap(RecordFormats.idBits(config)))
  val control = new TraceControl(config)
  val rays    = Flipped(Decoupled(new PreparedRay(config)))

  /** A ray that enters the object's box. */
  val entered = Valid(new PreparedRay(config))

  /** Fetches of the first record, of the next record, and of the attributes of a hit. */
  val fetches   = Vec(3, Valid(new FetchRequest(config)))
  val nodes     = Flipped(Decoupled(new NodeCandidate(config)))
  val triangles = Flipped(Decoupled(new TriangleCandidate(config)))

  /** To the triangle units that rows share. */
  val triangleLanes = Option.when(config.sharesTriangleUnits)(Flipped(new TriangleLanesIO(config)))
  val fetchError    = Flipped(Valid(Context(config)))

  /** `nodes` and `triangles` are ready in the next cycle. */
  val nodesReadyNext     = Output(Bool())
  val trianglesReadyNext = Output(Bool())

  /** A resolved context whose ray has a surface to shade; one cycle later its hit. After `control.measured`, the hit's
    * distance comes in the same way.
    */
  val hasSurface = Valid(Context(config))
  val surfaceHit = Valid(new SurfaceHit(config))
  val closestHit = Flipped(new GrantedHitReader(config))
  val events     = Output(new IntersectorEvents(config))
}

/** Intersects rays with the scene: BVH traversal, triangle tests, closest hits, and early termination of shadow rays.
  *
  * A ray requests its next record as soon as the current one is tested. A shadow ray ends at its first opaque hit.
  */
final class Intersector(config: ColonnadeConfig) extends Module {
  val io = IO(new IntersectorIO(config))

  private val traversal = Module(new Traversal(config))
  private val triangles = io.triangleLanes.getOrElse(Module(new TriangleLanes(config)).io)
  private val hitTable  = Module(new HitTable(config))
  private val control   = io.control

  // Start a trace, or end it at once if the ray misses the object's box
  private val ray = io.rays.bits
  io.rays.ready    := true.B
  io.entered.valid := io.rays.fire && ray.enters
  io.entered.bits  := ray
  drive(control.entered, io.entered.valid, ray.context)
  drive(traversal.io.start, io.entered.valid, ray.context)
  hitTable.io.start.valid        := io.rays.fire
  hitTable.io.start.bits.context := ray.context
  hitTable.io.start.bits.tMax    := ray.tMax
  drive(control.ended(0), io.rays.fire && !ray.enters, ray.context)
  fetch(io.fetches(0), io.entered.valid, ray.context, Traversal.root(config, io.scene))

  // Traverse the BVH
  private val step = traversal.io.steps
  traversal.io.clear := io.start
  traversal.io.scene := io.scene
  hitTable.io.tMax.zip(traversal.io.tMax).foreach { case (table, reader) => table :<>= reader }
  traversal.io.nodes :<>= io.nodes
  step.ready := true.B
  drive(control.ended(1), step.fire && step.bits.isDone, step.bits.context)
  fetch(io.fetches(1), step.fire && !step.bits.isDone, step.bits.context, step.bits.target)

  // Test triangles: a result terminates an occluded shadow ray, or the ray resumes after its record.
  // The termination is registered, so that no path leads from the triangle unit through the hit table to the controller
  private val result   = if (config.units.shortPaths) compared(Queue(triangles.result, 2)) else triangles.result
  private val isShadow = {
    val ofContext = control.isShadow(result.bits.context)
    if (config.units.shortPaths) RegNext(ofContext) else ofContext
  }
  private val isOccluded = isShadow && hitTable.io.hasHitNow
  private val resumes    = Module(new Arbiter(Context(config), 2))
  triangles.candidate :<>= io.triangles
  hitTable.io.result.valid := result.fire
  hitTable.io.result.bits  := result.bits
  hitTable.io.isShadow     := isShadow
  result.ready             := isOccluded || !result.bits.isLast || resumes.io.in(1).ready
  control.ended(2)         := Pipe(result.fire && result.bits.isLast && isOccluded, result.bits.context)

  // A record with an illegal address is skipped
  private val skipped =
    if (config.units.shortPaths) Pipe(io.fetchError.valid, io.fetchError.bits) else WireInit(io.fetchError)
  resumes.io.in(0).valid := skipped.valid
  resumes.io.in(0).bits  := skipped.bits
  resumes.io.in(1).valid := result.valid && result.bits.isLast && !isOccluded
  resumes.io.in(1).bits  := result.bits.context
  traversal.io.resume :<>= resumes.io.out

  // Fetch the attributes of a hit, unless it belongs to a shadow ray
  private val resolved   = control.resolved.bits
  private val hasSurface = control.shades
  private val closest    = hitTable.io.closest
  drive(io.hasSurface, hasSurface, resolved)
  private val reads   = hasSurface || control.measured.valid
  private val readHit = Mux(control.measured.valid, control.measured.bits, resolved)
  closest.context              := RegEnable(readHit, reads)
  io.surfaceHit.valid          := RegNext(hasSurface, false.B)
  io.surfaceHit.bits.context   := closest.context
  io.surfaceHit.bits.isPrimary := RegNext(control.isPrimary(resolved))
  io.surfaceHit.bits.id        := closest.id
  io.surfaceHit.bits.t         := closest.t
  for (distance <- io.surfaceHit.bits.distance) {
    val entries = ContextTable(config, UInt(config.numbers.entryBits.W))
    when(io.entered.valid) { entries.write(ray.context, ray.tEntry.natural) }
    distance := SurfaceHit.distance(config, entries.read(readHit, reads), closest.t)
  }
  assert(!(hasSurface && control.measured.valid), "one hit is read in a cycle")
  io.fetches(2).valid        := io.surfaceHit.valid
  io.fetches(2).bits.context := closest.context
  io.fetches(2).bits.kind    := RecordKind.attributes
  io.fetches(2).bits.address := SurfaceHit.attributeAddress(config, io.scene, closest.id)

  io.nodesReadyNext     := traversal.io.readyNext
  io.trianglesReadyNext := triangles.readyNext
  control.hasHit        := hitTable.io.hasHit(control.asked.bits)
  control.occlusion     := hitTable.io.occlusions(control.asked.bits)
  hitTable.io.granted :<>= io.closestHit

  io.events.raysInBox         := io.entered.valid
  io.events.nodeReads         := io.nodes.fire
  io.events.boxTests          := traversal.io.boxTests
  io.events.triangleTests     := result.fire
  io.events.busyBoxUnit       := traversal.io.busy
  io.events.busyTriangleUnit  := triangles.busy
  io.events.contextsBox       := Occupancy(config, Seq(io.nodes.fire, traversal.io.resume.fire), Seq(step.fire))
  io.events.contextsTriangles := Occupancy(config, Seq(io.triangles.fire), Seq(result.fire && result.bits.isLast))
  io.events.deepestStack      := traversal.io.deepest
  io.events.stackOverflow     := traversal.io.overflow
  // Behind a register, since shared triangle units take a record by a combinational path through the column
  private val isIllegal = RegNext(io.triangles.fire && !io.triangles.bits.record.isLegal, false.B)
  io.events.illegalRecord := traversal.io.illegal || isIllegal

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
    port.bits.kind    := Mux(target.isLeaf, RecordKind.triangles, RecordKind.node)
    port.bits.address := target.address
  }
}
