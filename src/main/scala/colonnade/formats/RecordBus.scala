package colonnade.formats

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.ColonnadeConfig

/** A read that a render unit asks its column for. It may be withdrawn while it is not accepted. */
final class RecordRequest(config: ColonnadeConfig) extends Bundle {
  val address = UInt(RecordFormats.addressBits(config).W)
}

/** A record that a bank has read, shown to all render units of the column for one cycle. */
final class RecordBroadcast(config: ColonnadeConfig) extends Bundle {
  val address = UInt(RecordFormats.addressBits(config).W)
  val record  = new RecordFormats(config).record

  /** The row that had asked for it. */
  val row = UInt(log2Ceil(config.array.rows.max(2)).W)
}
