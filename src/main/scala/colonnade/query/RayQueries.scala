package colonnade.query

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled, Queue, RRArbiter, Valid}
import colonnade.axi.{Axi, AxiReadPort, AxiWritePort}
import colonnade.common.{ContextTable, Dispatcher}
import colonnade.config.PathConfig
import colonnade.formats.{Bounds, RayBatch, RayPlacement, RaySensor}
import colonnade.ray.{PreparedRay, RaySetup}
import colonnade.traversal.TriangleHit
import colonnade.unit.TraceResult

/** `batch`, `right` of its sensor, `placement` and `bounds` are constant while runs are in the unit. */
final class RayQueriesIO(config: PathConfig) extends Bundle {
  val batch     = Input(new RayBatch)
  val right     = Input(RaySensor.vector)
  val placement = Input(new RayPlacement)
  val bounds    = Input(new Bounds(config.numbers))
  val runs      = Flipped(Decoupled(new Run))

  /** Runs that end: their hits are in memory, or have failed. */
  val resolved = Output(UInt(2.W))
  val failed   = Output(Bool())

  val read  = new AxiReadPort(1, RayBatch.bytes)
  val write = new AxiWritePort(1, RayBatch.bytes)

  /** Rays that enter the object's box, to the traversal units; what they have met. */
  val rays    = Decoupled(new PreparedRay(config))
  val results = Flipped(Valid(new TraceResult(config)))

  /** A ray comes that is none. */
  val refuses = Output(Bool())
}

/** Traces runs of rays: docs/rays.md, hardware. A run has a block of contexts, one for each of its rays, whose tables hold
  * what is known of it. Blocks are filled, and written when all their rays have ended, in the order of runs.
  *
  * A result is always accepted; a ray waits for a traversal unit, which waits for nothing here. So each block ends.
  */
final class RayQueries(config: PathConfig) extends Module {
  val io = IO(new RayQueriesIO(config))

  private val isOccluded = io.batch.response === RayBatch.occluded

  // Blocks
  private val blockBits = log2Ceil(Run.blocks)
  private val rayBits   = log2Ceil(Run.rays)
  private val head      = RegInit(0.U(blockBits.W))
  private val tail      = RegInit(0.U(blockBits.W))
  private val used      = RegInit(0.U(log2Ceil(Run.blocks + 1).W))
  private val runs      = Reg(Vec(Run.blocks, new Run))
  private val left      = Reg(Vec(Run.blocks, UInt(log2Ceil(Run.rays + 1).W))) // rays that have not ended
  private val hasFailed = Reg(Vec(Run.blocks, Bool()))

  // Read a run
  private val reader = Module(new RunReader(config)).io
  private val begins = io.runs.fire
  io.runs.ready     := reader.runs.ready && used =/= Run.blocks.U
  reader.runs.valid := io.runs.valid && used =/= Run.blocks.U
  reader.runs.bits  := io.runs.bits
  reader.batch      := io.batch
  reader.right      := io.right
  reader.block      := head
  io.read :<>= reader.axi
  when(begins) {
    head       := head + 1.U
    runs(head) := io.runs.bits
  }

  // Convert its rays, and prepare them
  private val lanes     = Seq.fill(RayQueries.lanes(config))(Module(new RayConverter(config)).io)
  private val dispatch  = Module(new Dispatcher(new BatchRay(config), lanes.size)).io
  private val converted = Module(new RRArbiter(new ConvertedRay(config), lanes.size)).io
  private val setup     = Module(RaySetup(config)).io
  private val scales    = ContextTable(config, new RayScale)
  dispatch.items :<>= reader.rays
  for (((lane, taker), result) <- lanes.zip(dispatch.takers).zip(converted.in)) {
    lane.placement := io.placement
    lane.rays :<>= taker
    result :<>= lane.converted
  }
  setup.bounds        := io.bounds
  setup.request.valid := converted.out.valid
  setup.request.bits  := converted.out.bits.request
  converted.out.ready := setup.request.ready
  io.refuses          := setup.request.fire && converted.out.bits.isRefused
  when(setup.request.fire) { scales.write(setup.request.bits.context, converted.out.bits.scale) }

  // Trace them; those that miss the box end here
  private val prepared = setup.ray.bits
  private val misses   = setup.ray.valid && !prepared.enters
  private val entries  = ContextTable(config, new RayEntryPoint(config))
  private val results  = ContextTable(config, new RayResult(config))
  io.rays.valid   := setup.ray.valid && prepared.enters
  io.rays.bits    := prepared
  setup.ray.ready := !prepared.enters || io.rays.ready
  when(setup.ray.fire) {
    val entry = Wire(new RayEntryPoint(config))
    entry.enters := prepared.enters
    entry.t      := prepared.tEntry.natural
    entries.write(prepared.context, entry)
  }
  when(io.results.valid) {
    val result = Wire(new RayResult(config))
    result.hasHit  := io.results.bits.hasHit
    result.hit     := io.results.bits.hit
    result.isClear := io.results.bits.isClear.get
    results.write(io.results.bits.context, result)
  }
  for (block <- 0 until Run.blocks) {
    def isIn(valid: Bool, context: UInt) = valid && Run.block(context) === block.U
    left(block) := left(block) - (isIn(io.results.valid, io.results.bits.context) +& isIn(misses, prepared.context))
    when(reader.failed.valid && reader.failed.bits === block.U) { hasFailed(block) := true.B }
    when(begins && head === block.U) {
      left(block)      := io.runs.bits.count
      hasFailed(block) := false.B
    }
  }

  // Read the tables of the oldest block when all its rays have ended
  private val isComplete = used =/= 0.U && left(tail) === 0.U
  private val drops      = isComplete && hasFailed(tail)
  private val index      = RegInit(0.U(rayBits.W))
  private val entry      = Reg(new TracedHit(config))
  private val hasEntry   = RegInit(false.B)
  private val entryReady = Wire(Bool())
  private val writing    = Module(new Queue(new WrittenRun, 4)).io
  private val reads      = Wire(Bool())
  private val isRead     = RegNext(reads, false.B)
  private val isFirst    = index === 0.U
  private val isLast     = index +& 1.U === runs(tail).count
  private val context    = Cat(tail, index)
  reads             := isComplete && !drops && !isRead && (!hasEntry || entryReady) && (!isFirst || writing.enq.ready)
  writing.enq.valid := reads && isFirst
  writing.enq.bits.hits  := runs(tail).hits
  writing.enq.bits.count := runs(tail).count
  private val frees = drops || (reads && isLast)
  used := used + begins - frees
  when(reads) { index := Mux(isLast, 0.U, index + 1.U) }
  when(frees) { tail := tail + 1.U }
  when(entryReady) { hasEntry := false.B }
  private val (scale, from, result) =
    (scales.read(context, reads), entries.read(context, reads), results.read(context, reads))
  when(isRead) {
    hasEntry         := true.B
    entry.scale      := scale
    entry.hasHit     := from.enters && result.hasHit
    entry.tEntry     := from.t
    entry.hit        := result.hit
    entry.isClear    := result.isClear
    entry.hasWeights := io.batch.response === RayBatch.hits
  }

  // Occluded rays: a bit each
  private val position  = RegInit(0.U(rayBits.W)) // in the run
  private val isEnd     = position +& 1.U === writing.deq.bits.count
  private val bits      = RegInit(0.U(Run.rays.W))
  private val hasWord   = RegInit(false.B)
  private val converter = Module(new HitConverter(config)).io
  private val writer    = Module(new HitWriter).io
  converter.placement  := io.placement
  converter.hits.valid := hasEntry && !isOccluded
  converter.hits.bits  := entry
  entryReady           := hasEntry && Mux(isOccluded, !hasWord, converter.hits.ready)
  private val passes = Mux(isOccluded, entryReady, writer.hits.fire)
  when(passes) { position := Mux(isEnd, 0.U, position + 1.U) }
  when(entryReady && isOccluded) {
    bits    := bits | (entry.hasHit << position)
    hasWord := isEnd
  }
  when(writer.hits.fire && isOccluded) {
    bits    := 0.U
    hasWord := false.B
  }

  // Write
  writer.address          := writing.deq.bits.hits
  writer.isWide           := io.batch.response === RayBatch.hits
  writer.hits.valid       := Mux(isOccluded, hasWord, converter.records.valid)
  writer.hits.bits.words  := Mux(isOccluded, bits, converter.records.bits.asUInt)
  writer.hits.bits.isLast := isOccluded || isEnd
  converter.records.ready := writer.hits.ready && !isOccluded
  writing.deq.ready       := writer.hits.fire && writer.hits.bits.isLast
  io.write :<>= writer.axi
  io.resolved := writer.written +& writer.failed +& drops
  io.failed   := writer.failed || drops
}

object RayQueries {

  /** Converters of rays: enough for a ray of each traversal unit every 23 cycles. */
  def lanes(config: PathConfig): Int = (2 * config.array.rows / 5).max(2)
}

final private class WrittenRun extends Bundle {
  val hits  = UInt(Axi.addressBits.W)
  val count = UInt(log2Ceil(Run.rays + 1).W)
}

final private class RayEntryPoint(config: PathConfig) extends Bundle {
  val enters = Bool()
  val t      = UInt(config.numbers.entryBits.W)
}

final private class RayResult(config: PathConfig) extends Bundle {
  val hasHit  = Bool()
  val hit     = new TriangleHit(config)
  val isClear = Bool()
}
