package colonnade.formats

import chisel3._
import chisel3.util.log2Ceil
import colonnade.common.TimingSlice
import colonnade.config.ColonnadeConfig

/** Banks are interleaved by record, a cache's by pair of lines. */
object Banks {

  /** Number of records in one bank of a scratchpad. */
  def depth(config: ColonnadeConfig): Int =
    (config.columnBvhMemory.depth + config.columnBvhMemory.banks - 1) / config.columnBvhMemory.banks

  def addressBits(config: ColonnadeConfig): Int = RecordFormats.addressBits(config) - numberBits(config)

  def isIn(config: ColonnadeConfig, address: UInt, bank: Int): Bool =
    if (config.columnBvhMemory.banks == 1) true.B
    else address(numberBits(config) + wordBits(config) - 1, wordBits(config)) === bank.U

  /** The address in the bank of a record. */
  def addressIn(config: ColonnadeConfig, address: UInt): UInt =
    (address >> (numberBits(config) + wordBits(config))).asUInt ## address(wordBits(config) - 1, 0)

  /** The record at an address in a bank. */
  def recordOf(config: ColonnadeConfig, addressIn: UInt, bank: UInt): UInt =
    (addressIn >> wordBits(config)).asUInt ## bank(numberBits(config) - 1, 0) ## addressIn(wordBits(config) - 1, 0)

  /** Most reads that a bank has in flight; a cache answers after two cycles, or three with an extra slice. */
  def readsInFlight(config: ColonnadeConfig): Int =
    if (config.columnBvhMemory.cache.nonEmpty) 3 + TimingSlice.extra(config).cycles
    else config.columnBvhMemory.readLatency + 1

  private def numberBits(config: ColonnadeConfig): Int = log2Ceil(config.columnBvhMemory.banks)

  /** Address bits within a stripe of a bank. */
  private def wordBits(config: ColonnadeConfig): Int =
    if (config.columnBvhMemory.cache.nonEmpty) log2Ceil(2 * SceneLines.records) else 0
}
