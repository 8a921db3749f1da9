package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, UIntToOH}
import colonnade.config.PartConfig
import colonnade.formats.RecordFormats

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
