package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, OHToUInt, RegEnable, Valid}
import colonnade.common.{Context, ContextTable, DelayLine}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{ObjectInstance, RecordFormats}
import colonnade.instance.{ObjectScale, WorldDistance}
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.RayFormats
import colonnade.shading.Occlusion

/** Where a context's ray enters the cube of an object. */
final class VisitEntry(config: PathConfig) extends Bundle {
  val context = Context(config)
  val tEntry  = new Fixed(new RayFormats(config.numbers).entry)
}

final class InstanceResultsIO(config: PathConfig) extends Bundle {

  /** What contexts wait for; one without an instance that is left also comes by `misses`. */
  val steps   = Flipped(Valid(new InstanceStep(config)))
  val scales  = Flipped(Valid(new VisitScale(config)))
  val entries = Flipped(Valid(new VisitEntry(config)))

  /** What rays meet in objects, from the traversal units; rays that meet nothing without a way to them. */
  val objectResults = Flipped(Valid(new TraceResult(config)))
  val misses        = Vec(2, Flipped(Decoupled(Context(config))))

  /** The next instance of a ray, or all that it has met; a nearer hit at any time. */
  val again   = Valid(new InstanceStep(config))
  val results = Valid(new TraceResult(config))
}

/** Compares the hits of a ray in one instance after the other: the nearest one stays, of equal ones the first. A result
  * a cycle, of the traversal units before rays that miss.
  */
final class InstanceResults(config: PathConfig) extends Module {
  private val numbers = config.numbers
  private val latency = WorldDistance.latency(numbers) + 1

  val io = IO(new InstanceResultsIO(config))

  private val steps   = ContextTable(config, new RayProgress(config))
  private val scales  = ContextTable(config, new ObjectScale(numbers))
  private val entries = ContextTable(config, new Fixed(new RayFormats(numbers).entry))
  when(io.steps.valid) { steps.write(io.steps.bits.context, io.steps.bits.progress) }
  when(io.scales.valid) { scales.write(io.scales.bits.context, io.scales.bits.scale) }
  when(io.entries.valid) { entries.write(io.entries.bits.context, io.entries.bits.tEntry) }

  // A result, or a miss in its place
  private val ofObject = io.objectResults.bits
  private val result   = Wire(new VisitResult)
  private val comes    = io.objectResults.valid || io.misses.map(_.valid).reduce(_ || _)
  result.context     := ofObject.context
  result.hasHit      := ofObject.hasHit && io.objectResults.valid
  result.occlusion   := Mux(io.objectResults.valid, ofObject.occlusion, Occlusion.none)
  result.id          := ofObject.hit.id
  result.weights     := ofObject.hit.weights
  result.backSide    := ofObject.hit.backSide
  io.misses(0).ready := !io.objectResults.valid
  io.misses(1).ready := !io.objectResults.valid && !io.misses(0).valid
  when(!io.objectResults.valid) { result.context := Mux(io.misses(0).valid, io.misses(0).bits, io.misses(1).bits) }

  // Its distance along the ray of the world; the rest of it comes out then
  private val distance = Module(new WorldDistance(config)).io
  private val line     = Module(new DelayLine(new VisitResult, latency - 1, isSteady = false)).io
  private val measured = comes && result.hasHit
  private val arrives  = Seq.iterate(comes, latency + 1)(RegNext(_, false.B))
  distance.distance.valid       := RegNext(measured, false.B)
  distance.distance.bits.tEntry := entries.read(result.context, measured)
  distance.distance.bits.scale  := scales.read(result.context, measured)
  distance.distance.bits.t      := RegNext(ofObject.hit.t)
  line.moves                    := true.B
  line.writes                   := comes
  line.in                       := result
  line.reads                    := arrives(latency - 2)

  // The nearest hit so far
  private val found     = RegNext(line.out)
  private val step      = steps.read(line.out.context, arrives(latency - 1))
  private val isNearer  = found.hasHit && !step.isShadow && distance.t.bits.integer < step.tMax.integer
  private val isDarker  = step.isShadow && found.occlusion.asUInt > step.occlusion.asUInt
  private val occlusion = Mux(isDarker, found.occlusion, step.occlusion)
  private val left      = step.left & ~step.next
  private val isLast    = left === 0.U || occlusion === Occlusion.opaque
  private val nearest   = Wire(new InstanceStep(config))
  nearest.context   := found.context
  nearest.isShadow  := step.isShadow
  nearest.left      := left
  nearest.tMax      := Mux(isNearer, distance.t.bits, step.tMax)
  nearest.hasHit    := step.hasHit || isNearer
  nearest.occlusion := occlusion

  private val isResolved = arrives(latency)
  private val resolved   = RegNext(nearest)
  io.again.valid               := RegNext(isResolved && !isLast, false.B)
  io.again.bits                := resolved
  io.results.valid             := RegNext(isResolved, false.B)
  io.results.bits.context      := resolved.context
  io.results.bits.hasHit       := resolved.hasHit
  io.results.bits.occlusion    := resolved.occlusion
  io.results.bits.hit.id       := RegNext(found.id)
  io.results.bits.hit.weights  := RegNext(found.weights)
  io.results.bits.hit.backSide := RegNext(found.backSide)
  io.results.bits.hit.t        := resolved.tMax
  io.results.bits.isClear.foreach(_ := DontCare)
  for (visit <- io.results.bits.visit) {
    visit.instance := RegNext(OHToUInt(step.next))
    visit.isNearer := RegNext(isNearer)
    visit.isLast   := RegNext(isLast)
  }

  /** What a ray has met in an object, but the distance. */
  private final class VisitResult extends Bundle {
    val context   = Context(config)
    val hasHit    = Bool()
    val occlusion = Occlusion()
    val id        = UInt(RecordFormats.idBits(config.device).W)
    val weights   = chiselTypeOf(ofObject.hit.weights)
    val backSide  = Bool()
  }
}

final class WorldFacesIO(config: PathConfig) extends Bundle {

  /** In the axes of an object; it may come in the next cycle. */
  val objectFace  = Flipped(Valid(new HitFace(config)))
  val mayComeNext = Output(Bool())

  /** Constant while a face is in the unit. */
  val instances = Input(Vec(config.device.frame.instances, new ObjectInstance(config.device)))

  /** A face is accepted in the next cycle; the context that gets its face then. */
  val mayTakeNext = Input(Bool())
  val grantNext   = Output(Valid(Context(config)))
  val face        = Output(Valid(new HitFace(config)))
}

/** Transforms the normals of hits to the axes of the world, a normal a cycle: a hit every four cycles. Source:
  * docs/numbers.md, section 10.
  */
final class WorldFaces(config: PathConfig) extends Module {
  val io = IO(new WorldFacesIO(config))

  private val vectors = 4
  private val last    = (vectors - 1).U

  // The first normal of a face is multiplied, and the others move up. A step later the sums move into the face in the
  // world. This one stays until it leaves, while the next face waits with its first products
  private val face     = Reg(new HitFace(config))
  private val isHeld   = RegInit(false.B)
  private val step     = Reg(UInt(log2Ceil(vectors).W))
  private val world    = Reg(new HitFace(config))
  private val isWhole  = RegInit(false.B)
  private val sums     = RegInit(false.B)
  private val sumStep  = Reg(UInt(log2Ceil(vectors).W))
  private val moves    = !(isWhole && sums && sumStep === 0.U)
  private val isReady  = isWhole || (sums && sumStep === last)
  private val gives    = isReady && io.mayTakeNext
  private val instance = io.instances(face.instance.get)
  isWhole        := isReady && !gives
  io.mayComeNext := (!isHeld || step >= (vectors - 2).U) && !io.objectFace.valid
  assert(!io.objectFace.valid || RegNext(io.mayComeNext, false.B), "a face comes when none may")

  // Products of a normal and the matrix; then their sums of three, to nearest even
  private val fraction = ObjectInstance.normalFraction
  private val most     = NumberFormats.unitNormal
  private val normals  = face.normals.toSeq :+ face.geometricNormal
  private val results  = world.normals.toSeq :+ world.geometricNormal
  private val inWorld  = instance.normal.map { row =>
    val terms = row.axes.zip(normals.head.axes).map { case (factor, each) =>
      RegEnable(factor * each.integer, isHeld && moves)
    }
    val raised = terms.reduce(_ +& _) +& (BigInt(1) << (fraction - 1)).S
    val whole  = Rounding.floor(raised, fraction)
    val isTie  = raised(fraction - 1, 0) === 0.U
    Rounding.saturate(Mux(isTie, whole & (-2).S, whole), -most, most)
  }
  when(moves) {
    sums    := isHeld
    sumStep := step
    step    := step + 1.U
    when(step === last) { isHeld := false.B }
    for ((to, from) <- normals.zip(normals.tail)) to := from
  }
  when(sums && moves) {
    for ((to, from) <- results.zip(results.tail)) to      := from
    for ((to, from) <- results.last.axes.zip(inWorld)) to := Fixed(to.format, from)
    when(sumStep === 0.U) {
      world.context  := face.context
      world.material := face.material + instance.materialBase
      world.instance.zip(face.instance).foreach { case (to, from) => to := from }
    }
  }

  when(io.objectFace.valid) {
    face   := io.objectFace.bits
    isHeld := true.B
    step   := 0.U
  }
  io.grantNext.valid := gives
  io.grantNext.bits  := world.context
  io.face.valid      := RegNext(gives, false.B)
  io.face.bits       := world
}
