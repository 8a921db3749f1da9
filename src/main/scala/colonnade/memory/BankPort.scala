package colonnade.memory

import chisel3._
import chisel3.util.{Decoupled, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Banks, RecordFormats}

/** The answer to a request of a bank: the record, or that it comes later. */
final class BankResponse(config: ColonnadeConfig) extends Bundle {
  val record = new RecordFormats(config).record

  /** A cache does not hold the record. A fill will bring it. */
  val isLater = if (config.columnBvhMemory.cache.nonEmpty) Some(Bool()) else None
}

/** The read port of one bank. Responses come in the order of requests, and cannot be stalled. */
final class BankPort(config: ColonnadeConfig) extends Bundle {
  val request  = Decoupled(UInt(Banks.addressBits(config).W)) // address in the bank
  val response = Flipped(Valid(new BankResponse(config)))

  /** From a cache: a record that nobody requests in this cycle, and its address in the bank; never with a response. */
  val fill = if (config.columnBvhMemory.cache.nonEmpty) Some(Flipped(Valid(new BankFill(config)))) else None
}

/** A record that a cache receives. */
final class BankFill(config: ColonnadeConfig) extends Bundle {
  val address = UInt(Banks.addressBits(config).W)
  val record  = new RecordFormats(config).record
}
