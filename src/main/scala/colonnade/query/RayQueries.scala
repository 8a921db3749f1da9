package colonnade.query

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Queue, Valid}
import colonnade.axi.{AxiReadPort, AxiWritePort}
import colonnade.common.{ContextTable, Dispatcher, Merger}
import colonnade.config.PathConfig
import colonnade.formats.{Bounds, RayBatch, RayPlacement, RaySensor}
import colonnade.ray.{PreparedRay, RaySetup}
import colonnade.traversal.TriangleHit
import colonnade.unit.TraceResult

/** `batch`, its `sensor`, `placement` and `bounds` are constant while runs are in the unit. */
final class RayQueriesIO(config: PathConfig) extends Bundle {
  val batch     = Input(new RayBatch)
  val sensor    = Input(new RaySensor)
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

  /** A malformed ray arrives. */
  val refuses = Output(Bool())
}

/** Traces runs of rays: docs/rays.md, hardware. A ray has a context, whose tables hold what is known of it: the next
  * one of a ring, so that the hits of rays, which end in any order, are read in the order of rays.
  *
  * A result is always accepted; a ray waits for a traversal unit, which waits for nothing here. So each ray ends.
  */
final class RayQueries(config: PathConfig) extends Module {
  val io = IO(new RayQueriesIO(config))

  private val isOccluded = io.batch.response === RayBatch.occluded

  // Read runs; their rays take contexts
  private val reader = Module(new RunReader(config)).io
  private val ring   = Module(new RayRing(config)).io
  io.runs.ready              := reader.runs.ready && ring.runs.ready
  reader.runs.valid          := io.runs.valid && ring.runs.ready
  reader.runs.bits           := io.runs.bits
  ring.runs.valid            := io.runs.valid && reader.runs.ready
  ring.runs.bits.hits        := io.runs.bits.hits
  ring.runs.bits.count       := io.runs.bits.count
  ring.runs.bits.isTile      := io.runs.bits.isTile
  reader.batch               := io.batch
  reader.sensor              := io.sensor
  reader.context             := ring.next.bits
  ring.issued.valid          := reader.rays.fire
  ring.issued.bits.isLast    := reader.isLast
  ring.issued.bits.hasFailed := reader.hasFailed
  io.read :<>= reader.axi

  // Convert them, and prepare them
  private val lanes     = Seq.fill(RayQueries.lanes(config))(Module(new RayConverter(config)).io)
  private val dispatch  = Module(new Dispatcher(new BatchRay(config), lanes.size)).io
  private val converted = Module(new Merger(new ConvertedRay(config), lanes.size)).io
  private val setup     = Module(RaySetup(config)).io
  private val scales    = ContextTable(config, new RayScale)
  dispatch.items.valid := reader.rays.valid && ring.next.valid
  dispatch.items.bits  := reader.rays.bits
  reader.rays.ready    := dispatch.items.ready && ring.next.valid
  for (((lane, taker), result) <- lanes.zip(dispatch.takers).zip(converted.givers)) {
    lane.placement := io.placement
    lane.rays :<>= taker
    result :<>= lane.converted
  }
  setup.bounds          := io.bounds
  setup.request.valid   := converted.items.valid
  setup.request.bits    := converted.items.bits.request
  converted.items.ready := setup.request.ready
  io.refuses            := setup.request.fire && converted.items.bits.isRefused
  when(setup.request.fire) { scales.write(setup.request.bits.context, converted.items.bits.scale) }

  // Trace them; rays that miss the box end here
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
  ring.ends(0).valid := io.results.valid
  ring.ends(0).bits  := io.results.bits.context
  ring.ends(1).valid := misses
  ring.ends(1).bits  := prepared.context

  // What has become of the oldest ray
  private val traced  = Wire(new TracedHit(config))
  private val oldest  = ring.rays.bits
  private val writing = Module(new Queue(new PlacedRun, 4)).io
  private val offers  = ring.rays.valid && !oldest.drops && (!oldest.isFirst || writing.enq.ready)
  private val isReady = Wire(Bool())
  private val drops   = ring.rays.fire && oldest.drops && oldest.isLast
  ring.rays.ready   := oldest.drops || (isReady && (!oldest.isFirst || writing.enq.ready))
  writing.enq.valid := ring.rays.fire && !oldest.drops && oldest.isFirst
  writing.enq.bits  := oldest.run
  private def read[T <: Data](table: SyncReadMem[T]): T = table.read(ring.read.bits, ring.read.valid)
  private val (scale, from, result) = (read(scales), read(entries), read(results))
  traced.scale      := scale
  traced.hasHit     := from.enters && result.hasHit
  traced.tEntry     := from.t
  traced.hit        := result.hit
  traced.isClear    := result.isClear
  traced.hasWeights := io.batch.response === RayBatch.hits

  // Occluded rays: a bit each
  private val bits      = RegInit(0.U(Run.rays.W))
  private val hasWord   = RegInit(false.B)
  private val converter = Module(new HitConverter(config)).io
  private val writer    = Module(new HitWriter).io
  converter.placement  := io.placement
  converter.hits.valid := offers && !isOccluded
  converter.hits.bits  := traced
  isReady              := Mux(isOccluded, !hasWord, converter.hits.ready)
  when(offers && isOccluded && !hasWord) {
    bits    := bits | (traced.hasHit << oldest.index)
    hasWord := oldest.isLast
  }
  when(writer.hits.fire && isOccluded) {
    bits    := 0.U
    hasWord := false.B
  }

  // Write
  private val position = RegInit(0.U(log2Ceil(Run.rays).W))    // in the run
  private val isEnd    = position +& 1.U === writing.deq.bits.count
  private val isRow    = writing.deq.bits.isTile && position(log2Ceil(Run.tileColumns) - 1, 0).andR
  private val offset   = RegInit(0.U(RayQueries.offsetBits.W)) // of a row of a tile
  when(writer.hits.fire && !isOccluded) { position := Mux(isEnd, 0.U, position + 1.U) }
  when(writer.hits.fire && isRow) {
    offset := Mux(isEnd, 0.U, offset + (io.sensor.columns << Mux(writer.isWide, 4.U, 3.U)))
  }
  writer.address          := writing.deq.bits.hits + offset
  writer.isWide           := io.batch.response === RayBatch.hits
  writer.hits.valid       := Mux(isOccluded, hasWord, converter.records.valid)
  writer.hits.bits.words  := Mux(isOccluded, bits, converter.records.bits.asUInt)
  writer.hits.bits.isLast := isOccluded || isEnd || isRow
  writer.hits.bits.isEnd  := isOccluded || isEnd
  converter.records.ready := writer.hits.ready && !isOccluded
  writing.deq.ready       := writer.hits.fire && writer.hits.bits.isEnd
  io.write :<>= writer.axi
  io.resolved := writer.written +& writer.failed +& drops
  io.failed   := writer.failed || drops
}

object RayQueries {

  /** Of a tile's last row: three rows of a sensor of the most rays. */
  private val offsetBits = log2Ceil((Run.tileRows - 1) * 16 * RayBatch.maxCount + 1)

  /** Converters of rays: enough for a ray of each traversal unit every 15 cycles. */
  def lanes(config: PathConfig): Int = (2 * config.device.array.rows / 5).max(2)
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
