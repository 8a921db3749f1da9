package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, RegEnable, Valid}
import colonnade.common.{Context, First, ReservedQueue, TimingSlice}
import colonnade.config.{AttributeFetchConfig, ColonnadeConfig, PathConfig}
import colonnade.formats.{InstanceNumber, RecordBroadcast, RecordFormats, RecordRequest, SceneMap}

/** A hit whose attributes are wanted. */
final class AttributeRequest(config: PathConfig) extends Bundle {
  val context = Context(config)
  val id      = UInt(RecordFormats.idBits(config.device).W) // packed triangle id

  val instance = InstanceNumber(config.device)
}

/** A record of a hit: its leaf, or the companion. */
final class AttributeResponse(config: PathConfig) extends Bundle {
  val hit       = new AttributeRequest(config)
  val isColours = Bool()
  val record    = new RecordFormats(config.device).record
}

final class AttributeFetchIO(config: PathConfig) extends Bundle {

  /** Invalidates all record buffers. */
  val start      = Input(Bool())
  val scene      = Input(new SceneMap(config.device))
  val requests   = Decoupled(new RecordRequest(config.device))
  val broadcasts = Flipped(Vec(config.device.columnBvhMemory.banks, Valid(new RecordBroadcast(config.device))))

  /** Never refused; at most one of a context at a time. */
  val hits = Flipped(Valid(new AttributeRequest(config)))

  /** A leaf is accepted in the next cycle. Companions always are. */
  val readyNext = Input(Bool())
  val response  = Output(Valid(new AttributeResponse(config)))

  /** The leaf in `response` wants its companion: it comes next, and then the leaf again. */
  val wantsColours = Input(Bool())

  /** A context whose address is illegal. */
  val error  = Output(Valid(Context(config)))
  val events = Output(new FetchEvents(AttributeFetch.slotConfig(config.device)))
}

/** Fetches the records of hits for a path unit: a leaf, or the leaf, its companion and the leaf again, which a buffer
  * or a cache mostly still has. Hits wait in a queue for one of the slots, which are the contexts of a [[RecordFetch]];
  * so as many records as there are slots may be awaited. Responses come in any order.
  *
  * @param most maximum number of slots
  */
final class AttributeFetch(config: PathConfig, most: Int = AttributeFetch.slots) extends Module {
  val io = IO(new AttributeFetchIO(config))

  private val slotConfig = AttributeFetch.slotConfig(config.device, most)
  private val slots      = slotConfig.contexts
  private val fetch      = Module(new RecordFetch(slotConfig)).io
  private val isUsed     = RegInit(VecInit.fill(slots)(false.B))
  private val owners     = Reg(Vec(slots, new AttributeRequest(config)))
  private val hasColours = io.scene.hasColours.map(_ => Reg(Vec(slots, Bool())))

  fetch.start      := io.start
  fetch.row        := config.device.array.rows.U
  fetch.scene      := io.scene
  fetch.broadcasts := io.broadcasts
  fetch.readyNext  := VecInit(false.B, io.readyNext, hasColours.isDefined.B)
  io.requests :<>= TimingSlice.queue(fetch.requests)

  // The first hit waits for a slot in a register, those behind it in a memory; there are never more than contexts
  private val waiting = Module(new ReservedQueue(new AttributeRequest(config), config.contexts.max(2))).io
  private val first   = RegInit(0.U.asTypeOf(Valid(new AttributeRequest(config))))
  private val hit     = Wire(Decoupled(new AttributeRequest(config)))
  private val free    = First(isUsed.map(!_)).bits
  private val isFirst = (!first.valid || hit.ready) && !waiting.validNext
  when(!first.valid || hit.ready)(first.valid := io.hits.valid && isFirst)
  when(io.hits.valid && isFirst)(first.bits   := io.hits.bits)
  waiting.in.valid := io.hits.valid && !isFirst
  waiting.in.bits := io.hits.bits
  waiting.mayTakeNext := !first.valid || hit.ready
  waiting.out.ready := hit.ready
  hit.valid := first.valid || waiting.out.valid
  hit.bits := Mux(first.valid, first.bits, waiting.out.bits)
  hit.ready := !isUsed.asUInt.andR
  assert(!(first.valid && waiting.out.valid), "two hits are the first")
  fetch.fetches.foreach(_ := 0.U.asTypeOf(fetch.fetches.head))
  fetch.fetches.head.valid        := hit.fire
  fetch.fetches.head.bits.context := free
  fetch.fetches.head.bits.kind    := RecordKind.leaf
  fetch.fetches.head.bits.address := hit.bits.id >> 1
  when(hit.fire) {
    isUsed(free) := true.B
    owners(free) := hit.bits
  }

  // Responses free their slots, but for a leaf that wants its companion
  private val response = fetch.response
  private val slot     = response.bits.context
  private val isLast   = WireInit(response.valid)
  io.response.valid          := response.valid
  io.response.bits.hit       := owners(slot)
  io.response.bits.isColours := false.B
  io.response.bits.record    := response.bits.record
  io.error.valid             := fetch.error.valid
  io.error.bits              := owners(fetch.error.bits.context).context
  when(isLast) { isUsed(slot) := false.B }
  when(fetch.error.valid) { isUsed(fetch.error.bits.context) := false.B }
  for (hasColours <- hasColours) {
    val isColours = response.bits.kind === RecordKind.colours
    val wants     = !isColours && io.wantsColours && !hasColours(slot)
    val again     = RegNext(response.valid && (isColours || wants), false.B)
    val next      = RegEnable(slot, response.valid)
    val companion = RegEnable(wants, response.valid)
    io.response.valid                             := response.valid && !wants
    io.response.bits.isColours                    := isColours
    isLast                                        := response.valid && !isColours && !wants
    when(hit.fire)(hasColours(free)                    := false.B)
    when(response.valid && isColours)(hasColours(slot) := true.B)
    fetch.fetches(1).valid                        := again
    fetch.fetches(1).bits.context                 := next
    fetch.fetches(1).bits.kind                    := Mux(companion, RecordKind.colours, RecordKind.leaf)
    fetch.fetches(1).bits.address                 := (owners(next).id >> 1) +& companion
  }

  io.events.waitRecord    := fetch.stalledContexts
  io.events.waitUnit      := fetch.readyContexts
  io.events.snoopHits     := fetch.snoopHits
  io.events.illegalRecord := fetch.error.valid
}

object AttributeFetch {

  /** Hits whose attributes are awaited at a time. */
  val slots: Int = 16

  /** Their record buffers: a hit needs a record for two or three cycles of its shading. */
  val buffers: Int = 2

  /** What its [[RecordFetch]] is built for. */
  def slotConfig(config: ColonnadeConfig, most: Int = slots): AttributeFetchConfig =
    AttributeFetchConfig(config, maxSlots = most, maxBuffers = buffers)
}
