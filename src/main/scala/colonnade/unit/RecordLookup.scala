package colonnade.unit

import chisel3._
import chisel3.util.{Mux1H, RegEnable, Valid}
import colonnade.common.TimingSlice
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
  * behind the comparators, and behind the choice of the fetch's port. A buffer that takes another address meanwhile does
  * not match.
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
