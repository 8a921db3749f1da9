package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, OHToUInt, Valid}
import colonnade.common.{Context, ContextTable, DelayLine}
import colonnade.config.PathConfig
import colonnade.formats.RecordFormats
import colonnade.instance.{ObjectScale, WorldDistance}
import colonnade.numbers.Fixed
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

/** Compares the hits of a ray in one instance after the other: the nearest one stays, of equal ones the first. A result a
  * cycle, of the traversal units before rays that miss.
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
