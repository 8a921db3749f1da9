package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.formats.RecordFormats

/** The read port of one bank, which may be a memory or a cache. Responses come in the order of requests, with any latency,
  * and cannot be stalled.
  */
final class BankPort(config: ColonnadeConfig) extends Bundle {

  /** Address in the bank. */
  val request  = Decoupled(UInt(Banks.addressBits(config).W))
  val response = Flipped(Valid(new RecordFormats(config).record))
}

/** Banks are interleaved by record: the low bits of a record's address select the bank, the others the word in it. */
object Banks {

  /** Number of records in one bank. */
  def depth(config: ColonnadeConfig): Int =
    (config.columnBvhMemory.depth + config.columnBvhMemory.banks - 1) / config.columnBvhMemory.banks

  def addressBits(config: ColonnadeConfig): Int = RecordFormats.addressBits(config) - numberBits(config)

  def isIn(config: ColonnadeConfig, address: UInt, bank: Int): Bool =
    if (config.columnBvhMemory.banks == 1) true.B else address(numberBits(config) - 1, 0) === bank.U

  def addressIn(config: ColonnadeConfig, address: UInt): UInt = address >> numberBits(config)

  private def numberBits(config: ColonnadeConfig): Int = log2Ceil(config.columnBvhMemory.banks)
}
