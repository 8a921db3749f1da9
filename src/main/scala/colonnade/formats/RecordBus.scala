package colonnade.formats

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.ColonnadeConfig

/** A read request of a traversal unit or of the attribute fetch to its column. It may be withdrawn until it is accepted. */
final class RecordRequest(config: ColonnadeConfig) extends Bundle {
  val address = UInt(RecordFormats.addressBits(config).W)
}

/** A record that a bank has read, broadcast to all requesters of the column for one cycle. */
final class RecordBroadcast(config: ColonnadeConfig) extends Bundle {
  val address = UInt(RecordFormats.addressBits(config).W)
  val record  = new RecordFormats(config).record
  val row     = UInt(log2Ceil(config.recordRequesters.max(2)).W) // the row that requested it

  /** With a cache: this is no record. The cache awaits it, and another broadcast will bring it. */
  val isLater = if (config.columnBvhMemory.cache.nonEmpty) Some(Bool()) else None
}
