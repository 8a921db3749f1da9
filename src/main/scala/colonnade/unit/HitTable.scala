package colonnade.unit

import chisel3._
import chisel3.util.Valid
import colonnade.common.{Context, ContextTable}
import colonnade.config.ColonnadeConfig
import colonnade.formats.RecordFormats
import colonnade.numbers.Fixed
import colonnade.ray.RayFormats
import colonnade.shading.Occlusion
import colonnade.traversal.{LimitUnits, TriangleHit, TriangleResult}

/** A ray that begins to look for hits nearer than `limit`. */
final class Search(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val limit   = new Fixed(new RayFormats(config.numbers).grid)
}

/** The best hit of every context's ray: the least (t, packed triangle id), so that the order of tests does not matter.
  *
  * A result is taken every cycle; what it changes shows in the next one. After a shadow ray has begun, the hit of its
  * context means nothing.
  */
final class HitTable(config: ColonnadeConfig) extends Module {
  private val contexts = config.array.contexts
  private val formats  = new RayFormats(config.numbers)

  val io = IO(new Bundle {
    val search = Flipped(Valid(new Search(config)))
    val result = Flipped(Valid(new TriangleResult(config)))

    /** Of the result's ray: it is a shadow ray, and hits at the very limit (the light) do not count. */
    val isShadow = Input(Bool())

    /** The result's ray has hit something, this result included; of a shadow ray only what is opaque counts. */
    val hasHitNow = Output(Bool())

    /** By context: largest entry distance that may still hold a nearer hit, and whether there is a hit. */
    val limits = Output(Vec(contexts, new Fixed(formats.units)))
    val hasHit = Output(Vec(contexts, Bool()))

    /** By context: what its shadow ray has met. */
    val occlusions = Output(Vec(contexts, Occlusion()))

    /** Distance and id of the hit of the context named, in the same cycle. */
    val nearest = Flipped(new NearestReader(config))

    /** The hit of the context chosen one cycle before, which is named once more. */
    val chosen = Flipped(Valid(Context(config)))
    val served = Input(Context(config))
    val hit    = Output(new TriangleHit(config))
  })

  private val bests  = Reg(Vec(contexts, new Fixed(formats.grid)))
  private val ids    = Reg(Vec(contexts, UInt(RecordFormats.idBits(config).W)))
  private val limits = Reg(Vec(contexts, new Fixed(formats.units)))
  private val hasHit = Reg(Vec(contexts, Bool()))

  /** A shadow ray has met a clear triangle. */
  private val hasPassed = Reg(Vec(contexts, Bool()))
  private val details   = ContextTable(config, new HitDetails(config))

  // Hold a result against the best so far
  private val context  = io.result.bits.context
  private val hit      = io.result.bits.hit
  private val best     = bests(context)
  private val isTied   = hit.t.integer === best.integer && hasHit(context) && hit.id < ids(context)
  private val isNearer = io.result.bits.isHit && (hit.t < best || (isTied && !io.isShadow))
  private val isClear  = io.isShadow && io.result.bits.isClear && config.frame.hasBounces.B
  io.hasHitNow := hasHit(context) || (isNearer && !isClear)
  when(io.result.valid && isNearer) {
    when(isClear)(hasPassed(context) := true.B).otherwise(hasHit(context) := true.B)
  }
  when(io.result.valid && isNearer && !io.isShadow) {
    val detail = Wire(new HitDetails(config))
    detail.weights  := hit.weights
    detail.backSide := hit.backSide
    details.write(context, detail)
    ids(context)    := hit.id
    bests(context)  := hit.t
    limits(context) := LimitUnits(config.numbers)(hit.t)
  }

  when(io.search.valid) {
    bests(io.search.bits.context)     := io.search.bits.limit
    limits(io.search.bits.context)    := LimitUnits(config.numbers)(io.search.bits.limit)
    hasHit(io.search.bits.context)    := false.B
    hasPassed(io.search.bits.context) := false.B
  }

  io.limits     := limits
  io.hasHit     := hasHit
  io.occlusions := VecInit(hasHit.zip(hasPassed).map { case (hit, passed) =>
    Mux(hit, Occlusion.opaque, Mux(passed, Occlusion.transmissive, Occlusion.none))
  })
  io.nearest.t  := bests(io.nearest.context)
  io.nearest.id := ids(io.nearest.context)

  private val detail = details.read(io.chosen.bits, io.chosen.valid)
  io.hit.t        := bests(io.served)
  io.hit.id       := ids(io.served)
  io.hit.weights  := detail.weights
  io.hit.backSide := detail.backSide
}

/** What nobody compares of a hit. */
private final class HitDetails(config: ColonnadeConfig) extends Bundle {
  val weights  = Vec(3, new Fixed(new RayFormats(config.numbers).weight))
  val backSide = Bool()
}

/** A read port of the [[HitTable]], seen from its user. */
final class NearestReader(config: ColonnadeConfig) extends Bundle {
  val context = Output(Context(config))
  val t       = Input(new Fixed(new RayFormats(config.numbers).grid))
  val id      = Input(UInt(RecordFormats.idBits(config).W))
}
