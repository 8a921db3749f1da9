package colonnade.unit

import chisel3._
import chisel3.util.{RegEnable, Valid}
import colonnade.common.{Context, ContextTable, TimingSlice}
import colonnade.config.TraversalConfig
import colonnade.formats.RecordFormats
import colonnade.numbers.Fixed
import colonnade.ray.{EntryLimits, PreparedRay, QueryBits, RayFormats}
import colonnade.shading.Occlusion
import colonnade.traversal.{TMaxReader, TMaxUnits, TriangleHit, TriangleResult}

/** A ray whose trace starts: only hits with t < `tMax` count. */
final class TraceStart(config: TraversalConfig) extends Bundle {
  val context = Context(config)
  val tMax    = new Fixed(new RayFormats(config.numbers).grid)
}

final class HitTableIO(config: TraversalConfig) extends Bundle {
  val start  = Flipped(Valid(new TraceStart(config)))
  val result = Flipped(Valid(new TriangleResult(config)))

  /** The ray of `result` is a shadow ray: its hits do not shorten it. */
  val isShadow = Input(Bool())

  /** The ray of `result` has a hit, this result included; for a shadow ray only opaque hits count. */
  val hasHitNow = Output(Bool())

  /** For box unit and stack; what the ray of a context has met. */
  val tMax    = Vec(2, Flipped(new TMaxReader(config)))
  val outcome = Flipped(new HitReader(config))
}

/** The closest hit of every context's ray: the least (t, packed triangle id), whatever the order of tests.
  *
  * Throughput: one result per cycle, visible in the next cycle. A shadow ray overwrites the hit of its context. With
  * `units.extraSlices` the comparison takes a cycle: a result's bits are also there in the cycle before its `valid`.
  */
final class HitTable(config: TraversalConfig) extends Module {
  private val contexts = config.contexts
  private val formats  = new RayFormats(config.numbers)

  val io = IO(new HitTableIO(config))

  private val closestT           = Reg(Vec(contexts, new Fixed(formats.grid)))
  private val ids                = Reg(Vec(contexts, UInt(RecordFormats.idBits(config.device).W)))
  private val hasHit             = Reg(Vec(contexts, Bool()))
  private val hasTransmissiveHit = Reg(Vec(contexts, Bool())) // the shadow ray has hit a transmissive triangle
  private val details            = ContextTable(config, new HitDetails(config))

  // Compare the result with the closest hit so far
  private val compared       = TimingSlice.extra(config.device)
  private val context        = io.result.bits.context
  private val hit            = io.result.bits.hit
  private val best           = closestT(context)
  private val hadHit         = compared(hasHit(context))
  private val isTied         = compared(hit.t.integer === best.integer) && hadHit && compared(hit.id < ids(context))
  private val isCloser       = io.result.bits.isHit && (compared(hit.t < best) || (isTied && !io.isShadow))
  private val isTransmissive = io.isShadow && io.result.bits.isTransmissive && config.device.frame.hasBounces.B
  io.hasHitNow := hadHit || (isCloser && !isTransmissive)
  when(io.result.valid && isCloser) {
    when(isTransmissive)(hasTransmissiveHit(context) := true.B).otherwise(hasHit(context) := true.B)
  }
  when(io.result.valid && isCloser && !io.isShadow) {
    val detail = Wire(new HitDetails(config))
    detail.weights  := hit.weights
    detail.backSide := hit.backSide
    detail.isClear.foreach(_ := io.result.bits.isTransmissive)
    details.write(context, detail)
    ids(context)      := hit.id
    closestT(context) := hit.t
  }

  when(io.start.valid) {
    closestT(io.start.bits.context)           := io.start.bits.tMax
    hasHit(io.start.bits.context)             := false.B
    hasTransmissiveHit(io.start.bits.context) := false.B
  }

  io.tMax.foreach(reader => reader.units := TMaxUnits(config.numbers)(closestT(reader.context)))

  // The ray's outcome, one cycle after its context
  private val asked  = io.outcome.context
  private val reader = RegEnable(asked.bits, asked.valid)
  private val detail = details.read(asked.bits, asked.valid)
  io.outcome.hasHit    := hasHit(reader)
  io.outcome.occlusion :=
    Mux(hasHit(reader), Occlusion.opaque, Mux(hasTransmissiveHit(reader), Occlusion.transmissive, Occlusion.none))
  io.outcome.hit.t        := closestT(reader)
  io.outcome.hit.id       := ids(reader)
  io.outcome.hit.weights  := detail.weights
  io.outcome.hit.backSide := detail.backSide
  io.outcome.isClear.zip(detail.isClear).foreach { case (to, from) => to := from }
}

/** The parts of a hit that no comparison needs. */
private final class HitDetails(config: TraversalConfig) extends Bundle {
  val weights  = Vec(3, new Fixed(new RayFormats(config.numbers).weight))
  val backSide = Bool()
  val isClear  = QueryBits(config)(Bool())
}

/** A read port of the [[HitTable]], seen from the reader. */
final class HitReader(config: TraversalConfig) extends Bundle {
  val context = Output(Valid(Context(config)))

  /** In the next cycle: the ray has a hit; what it has hit as a shadow ray; its hit. */
  val hasHit    = Input(Bool())
  val occlusion = Input(Occlusion())
  val hit       = Input(new TriangleHit(config))
  val isClear   = QueryBits(config)(Input(Bool()))
}

final class HitLimitsIO(config: TraversalConfig) extends Bundle {
  val rays   = Flipped(Valid(new PreparedRay(config)))
  val result = Input(new TriangleResult(config))
  val isHit  = Output(Bool())
}

/** Decides whether a result is a hit of its context's ray: not before its tMin, and of a triangle that it does not
  * leave out. Combinational, from the ray that the context got last. Source: docs/numbers.md, section 9.
  */
final class HitLimits(config: TraversalConfig) extends Module {
  val io = IO(new HitLimitsIO(config))

  private val table = Reg(Vec(config.contexts, new EntryLimits(config.numbers)))
  when(io.rays.valid) { table(io.rays.bits.context) := io.rays.bits.limits.get }

  private val limits   = table(io.result.context)
  private val filter   = limits.filter
  private val hit      = io.result.hit
  private val isBefore = hit.t.integer.asUInt < limits.tMin // a hit is at t ≥ 0
  private val isCulled = Mux(hit.backSide, filter.cullsBack, filter.cullsFront)
  io.isHit := io.result.isHit && !isBefore && !isCulled && !(filter.refusesClear && io.result.isTransmissive)
}
