package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled, UIntToOH, Valid}
import colonnade.common.{Context, ContextTable, TimingSlice}
import colonnade.config.{PartConfig, TraversalConfig}
import colonnade.formats.{RecordBroadcast, RecordFormats, RecordRequest, SceneMap}
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.{BoxRay, PreparedRay, RayFormats, RayOrientation, TracedRay, TriangleRay}
import colonnade.traversal.TriangleCandidate

final class FetchStageIO(config: TraversalConfig) extends Bundle {

  /** Invalidates all record buffers. */
  val start      = Input(Bool())
  val row        = Input(UInt(log2Ceil(config.device.recordRequesters.max(2)).W))
  val scene      = Input(new SceneMap(config.device))
  val requests   = Decoupled(new RecordRequest(config.device))
  val broadcasts = Flipped(Vec(config.device.columnBvhMemory.banks, Valid(new RecordBroadcast(config.device))))

  /** A ray whose trace starts. */
  val ray     = Flipped(Valid(new PreparedRay(config)))
  val fetches = Flipped(Vec(2, Valid(new FetchRequest(config))))

  /** A record with the ray of its context; one of the two ports in a cycle. */
  val nodes     = Decoupled(new NodeCandidate(config))
  val triangles = Decoupled(new TriangleCandidate(config))

  /** `nodes` and `triangles` are ready in the next cycle. */
  val nodesReadyNext     = Input(Bool())
  val trianglesReadyNext = Input(Bool())

  /** A record waits for a triangle unit; a context gets no record because its address is illegal. */
  val waitsForTriangles = Output(Bool())
  val error             = Output(Valid(Context(config)))
  val events            = Output(new FetchEvents(config))
}

/** Fetches records and joins each one with the ray of its context, which a table holds.
  *
  * The table is read with the context that [[RecordFetch]] grants one cycle early, so it may be a memory with a
  * registered address, and no combinational path connects the units that accept records.
  */
final class FetchStage(config: TraversalConfig) extends Module {
  private val formats = new RecordFormats(config.device)

  val io = IO(new FetchStageIO(config))

  private val recordFetch = Module(new RecordFetch(config))
  recordFetch.io.start      := io.start
  recordFetch.io.row        := io.row
  recordFetch.io.scene      := io.scene
  recordFetch.io.broadcasts := io.broadcasts
  recordFetch.io.fetches    := io.fetches :+ 0.U.asTypeOf(io.fetches.head)
  recordFetch.io.readyNext  := VecInit(io.nodesReadyNext, io.trianglesReadyNext, false.B)
  // In a queue requests are not withdrawn
  io.requests :<>= TimingSlice.extra(config.device).queue(recordFetch.io.requests)
  io.waitsForTriangles := recordFetch.io.waitsForTriangles

  private val rays = new RayTable(config)
  when(io.ray.valid) { rays.write(io.ray.bits.context, io.ray.bits.ray) }

  // Join the record with the ray of its context
  private val response              = recordFetch.io.response.bits
  private val (boxRay, triangleRay) = rays.read(recordFetch.io.grantNext, recordFetch.io.grantsNodeNext)
  io.nodes.valid        := isFor(RecordKind.node)
  io.nodes.bits.context := response.context
  io.nodes.bits.address := response.address
  io.nodes.bits.node    := formats.asNode(response.record)
  io.nodes.bits.ray     := boxRay

  io.triangles.valid        := isFor(RecordKind.leaf)
  io.triangles.bits.context := response.context
  io.triangles.bits.address := response.address
  io.triangles.bits.record  := response.record
  io.triangles.bits.ray     := triangleRay

  assert(!io.nodes.valid || io.nodes.ready, "the box unit does not accept its node")
  assert(!io.triangles.valid || io.triangles.ready, "the triangle unit does not accept its record")
  io.triangles.bits.isMasked.foreach(_ := false.B) // the column compares masks

  // Errors and events
  private val error = recordFetch.io.error
  io.error.valid          := error.valid
  io.error.bits           := error.bits.context
  io.events.waitRecord    := recordFetch.io.stalledContexts
  io.events.waitUnit      := recordFetch.io.readyContexts
  io.events.snoopHits     := recordFetch.io.snoopHits
  io.events.illegalRecord := error.valid

  private def isFor(kind: RecordKind.Type): Bool = recordFetch.io.response.valid && response.kind === kind
}

/** The rays of all contexts: what every test needs, and what only box tests or only triangle tests need. So a read
  * moves 113 or 125 bits instead of 176 in `edge`.
  */
private final class RayTable(config: TraversalConfig) {
  private val numbers      = config.numbers
  private val formats      = new RayFormats(numbers)
  private val fractionBits = numbers.gridFraction.max(0)
  private val zeroBits     = (-numbers.gridFraction).max(0)

  private final class Frame extends Bundle {
    val orientation = new RayOrientation
    val whole       = Vec(3, SInt((numbers.gridBits - fractionBits).W))
  }
  private final class ForBoxes extends Bundle {
    val roundsUp   = Vec(3, Bool())
    val reciprocal = Vec(2, new Fixed(formats.reciprocal))
    val exponent   = Vec(2, UInt(formats.exponentBits.W))
  }
  private final class ForTriangles extends Bundle {
    val fraction = Vec(3, UInt(fractionBits.W))
    val shear    = Vec(2, new Fixed(formats.shear))
  }
  private val frames       = ContextTable(config, new Frame)
  private val forBoxes     = ContextTable(config, new ForBoxes)
  private val forTriangles = ContextTable(config, new ForTriangles)

  def write(context: UInt, ray: TracedRay): Unit = {
    val frame     = Wire(new Frame)
    val boxes     = Wire(new ForBoxes)
    val triangles = Wire(new ForTriangles)
    frame.orientation  := ray.orientation
    frame.whole        := VecInit(ray.origin.map(_.integer >> fractionBits))
    boxes.roundsUp     := ray.forBoxes.roundsUp
    boxes.reciprocal   := ray.reciprocal
    boxes.exponent     := ray.exponent
    triangles.fraction := VecInit(ray.origin.map(_.integer.asUInt(fractionBits - 1, 0)))
    triangles.shear    := ray.shear
    frames.write(context, frame)
    forBoxes.write(context, boxes)
    forTriangles.write(context, triangles)
  }

  /** The ray in the next cycle; the one for box tests is valid if `readsBoxes`, and else the one for triangle tests. */
  def read(context: Valid[UInt], readsBoxes: Bool): (BoxRay, TriangleRay) = {
    val frame       = frames.read(context.bits, context.valid)
    val boxes       = forBoxes.read(context.bits, context.valid && readsBoxes)
    val triangles   = forTriangles.read(context.bits, context.valid && !readsBoxes)
    val boxRay      = Wire(new BoxRay(numbers))
    val triangleRay = Wire(new TriangleRay(numbers))
    boxRay.orientation      := frame.orientation
    boxRay.roundsUp         := boxes.roundsUp
    boxRay.reciprocal       := boxes.reciprocal
    boxRay.exponent         := boxes.exponent
    triangleRay.orientation := frame.orientation
    triangleRay.shear       := triangles.shear
    for (axis <- 0 until 3) {
      val whole = frame.whole(axis)
      boxRay.origin(axis)      := Fixed(formats.units, Rounding.narrow(whole << zeroBits, numbers.boxDistanceBits))
      triangleRay.origin(axis) := Fixed(formats.grid, Cat(whole, triangles.fraction(axis)).asSInt)
    }
    (boxRay, triangleRay)
  }
}

private[unit] object BufferState extends ChiselEnum {
  val empty, reserved, full = Value
}

/** The registers of a record buffer of [[RecordFetch]]. */
private[unit] final class RecordBuffer(config: PartConfig) {
  val state   = RegInit(BufferState.empty)
  val address = Reg(UInt(RecordFormats.addressBits(config.device).W))
  val record  = Reg(new RecordFormats(config.device).record)

  /** With a cache: stays reserved when the record comes later. */
  val isPinned = Option.when(config.device.columnBvhMemory.cache.nonEmpty)(Reg(Bool()))
}

/** The registers of a context's fetch in [[RecordFetch]]. */
private[unit] final class ContextFetch(config: PartConfig) {
  private val buffers  = config.device.columnBvhMemory.recordBuffers
  private val hasCache = config.device.columnBvhMemory.cache.nonEmpty

  val kind      = Reg(RecordKind())
  val address   = Reg(UInt(RecordFormats.addressBits(config.device).W))
  val isPending = RegInit(false.B) // the context waits for the record
  val isIllegal = RegInit(false.B) // the fetch waits to report its error and takes no record, whatever the buffers hold
  val hasRecord = RegInit(false.B) // `buffer` has the record
  val isIssued  = Reg(Bool())      // the context has requested its own read, which fills `buffer`
  val buffer    = Reg(UInt(log2Ceil(buffers.max(2)).W))

  /** A reserved buffer, of any context, awaits the record. */
  val isExpected = Reg(Bool())

  /** With a cache: the record comes later, without a request; the context has missed the broadcast that it awaited. */
  val awaitsFill = Option.when(hasCache)(RegInit(false.B))
  val retries    = Option.when(hasCache)(Reg(Bool()))

  /** `buffer` by its bit. */
  val bufferOH: Seq[Bool] = UIntToOH(buffer, buffers).asBools
}
