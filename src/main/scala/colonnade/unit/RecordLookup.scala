package colonnade.unit

import chisel3._
import chisel3.util.{Mux1H, OHToUInt, PriorityEncoderOH, RegEnable, Valid}
import colonnade.common.{Context, TimingSlice}
import colonnade.config.PartConfig
import colonnade.formats.RecordFormats

final class RecordLookupIO(config: PartConfig) extends Bundle {
  private val contexts = config.contexts
  private val buffers  = config.device.columnBvhMemory.recordBuffers

  val fetches = Flipped(Vec(RecordFetch.ports, Valid(new FetchRequest(config))))

  /** By buffer: its address, and whether it takes another one in this cycle. */
  val addresses = Input(Vec(buffers, UInt(RecordFormats.addressBits(config.device).W)))
  val isWritten = Input(Vec(buffers, Bool()))

  /** By context and buffer, in one cycle after a fetch: the buffer has its address. */
  val matches = Output(Vec(contexts, Vec(buffers, Bool())))

  /** By context: its fetch came in the cycle before; the matches of its fetch are still to come; they come or are to
    * come.
    */
  val isNew      = Output(Vec(contexts, Bool()))
  val isUnderWay = Output(Vec(contexts, Bool()))
  val isSettling = Output(Vec(contexts, Bool()))
}

/** Lookup: compares the address of a new fetch with all buffers', once. Later only a fill or a new reservation
  * changes what a fetch finds. The matches come in the cycle after the fetch. Two extra slices make it the third cycle:
  * behind the comparators, and behind the choice of the fetch's port. A buffer that takes another address meanwhile
  * does not match.
  */
final class RecordLookup(config: PartConfig) extends Module {
  val io = IO(new RecordLookupIO(config))

  private val slice = TimingSlice.extra(config.device)

  // By context and port
  private val comesFrom = Seq.tabulate(config.contexts) { context =>
    VecInit(io.fetches.map(port => port.valid && port.bits.context === context.U))
  }

  // By port and buffer
  private val portMatches = io.fetches.map { port =>
    val address = RegEnable(port.bits.address, port.valid)
    passed(io.addresses.map(_ === address))
  }

  for ((from, context) <- comesFrom.zipWithIndex) {
    val comes      = from.asUInt.orR
    val isNew      = RegNext(comes, false.B)
    val isUnderWay = isNew || RegNext(isNew, false.B)
    val port       = slice(RegNext(from, VecInit.fill(from.size)(false.B)))
    io.isNew(context)      := isNew
    io.isUnderWay(context) := isUnderWay && slice.isEnabled.B
    io.isSettling(context) := (if (slice.isEnabled) RegNext(comes || isUnderWay, false.B) else isNew)
    io.matches(context)    := VecInit(passed(portMatches.transpose.map(Mux1H(port, _))))
  }

  /** Matches by buffer, behind a slice. */
  private def passed(matches: Seq[Bool]): Seq[Bool] = if (slice.isEnabled)
    matches.zip(io.isWritten).map { case (isMatch, isWritten) => RegNext(isMatch && !isWritten) }
  else matches
}

/** A context with its kind of record and the buffer that holds it, one-hot. */
final class RecordGrantee(config: PartConfig) extends Bundle {
  val context = Context(config)
  val kind    = RecordKind()
  val buffer  = Vec(config.device.columnBvhMemory.recordBuffers, Bool())
}

final class RecordGrantIO(config: PartConfig) extends Bundle {
  private val contexts = config.contexts

  /** By context: its record is there; the kind; and the buffer that holds it, one-hot. */
  val isReady = Input(Vec(contexts, Bool()))
  val kinds   = Input(Vec(contexts, RecordKind()))
  val holders = Input(Vec(contexts, Vec(config.device.columnBvhMemory.recordBuffers, Bool())))

  /** By kind: its unit accepts a record in the next cycle. */
  val readyNext = Input(Vec(RecordKind.all.size, Bool()))

  /** The context that is granted in the next cycle, also one-hot, and whether its record is a node. */
  val grantNext      = Output(Valid(Context(config)))
  val grantOH        = Output(Vec(contexts, Bool()))
  val grantsNodeNext = Output(Bool())

  /** The one that is granted now. */
  val granted = Output(Valid(new RecordGrantee(config)))
}

/** Grant: serves the first ready context of the kind with the highest priority whose unit accepts a record. The choice
  * is registered: it addresses the tables of the context in one cycle, and in the next one the record leaves its
  * buffer. So the buffer may be replaced in that cycle. Triangles have priority, because the triangle unit starts only
  * in every fourth cycle. Attributes are second and nodes last.
  */
final class RecordGrant(config: PartConfig) extends Module {
  val io = IO(new RecordGrantIO(config))

  private val firstOfKind = RecordKind.all.map { kind =>
    PriorityEncoderOH(io.isReady.zip(io.kinds).map { case (isReady, of) => isReady && of === kind })
  }
  private val isRequested = firstOfKind.zip(io.readyNext).map { case (first, isReady) =>
    first.reduce(_ || _) && isReady
  }
  private val kindOH = RecordGrant.priority.zip(PriorityEncoderOH(RecordGrant.priority.map(isRequested(_))))
    .sortBy { case (kind, _) => kind }
    .map { case (_, isGranted) => isGranted }
  private val grantOH =
    firstOfKind.transpose.map(_.zip(kindOH).map { case (is, ofKind) => is && ofKind }.reduce(_ || _))

  private val next = Wire(Valid(new RecordGrantee(config)))
  next.valid         := kindOH.reduce(_ || _)
  next.bits.context  := OHToUInt(grantOH)
  next.bits.kind     := RecordKind.safe(OHToUInt(kindOH))._1
  next.bits.buffer   := Mux1H(grantOH, io.holders)
  io.grantNext.valid := next.valid
  io.grantNext.bits  := next.bits.context
  io.grantOH         := VecInit(grantOH)
  io.grantsNodeNext  := kindOH(RecordKind.node.litValue.toInt)
  io.granted.valid   := RegNext(next.valid, false.B)
  io.granted.bits    := RegEnable(next.bits, next.valid)
}

private object RecordGrant {

  /** Record kinds by falling priority. */
  val priority: Seq[Int] = Seq(RecordKind.leaf, RecordKind.colours, RecordKind.node).map(_.litValue.toInt)
}
