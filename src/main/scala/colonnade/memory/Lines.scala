package colonnade.memory

import chisel3._
import chisel3.util.{log2Ceil, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RecordFormats, SceneLines}

/** A line is two consecutive records. Lines 2n and 2n + 1, *buddies*, lie in bank n mod `banks`, as numbers 2 · (n / `banks`)
  * and the next one of that bank.
  */
object Lines {
  val records:  Int = SceneLines.records
  val wordBits: Int = log2Ceil(records)

  /** Width of the number of a line in its bank. */
  def lineBits(config: ColonnadeConfig): Int =
    RecordFormats.addressBits(config) - wordBits - log2Ceil(config.columnBvhMemory.banks)

  /** The other line of a pair. */
  def buddy(line: UInt): UInt = line ^ 1.U

  /** The number of a bank's line in the scene. */
  def numberOf(config: ColonnadeConfig, line: UInt, bank: UInt): UInt =
    (line >> 1).asUInt ## bank(log2Ceil(config.columnBvhMemory.banks) - 1, 0) ## line(0)

  /** Whether records have a parity bit from the DRAM port to their requesters. */
  def hasParity(config: ColonnadeConfig): Boolean = config.columnBvhMemory.cache.exists(_.parity)

  /** A record in a cache or on a bus: its parity is the most significant bit, if it has one. Zeros have the right parity. */
  def stored(config: ColonnadeConfig): UInt =
    UInt((new RecordFormats(config).recordBits + (if (hasParity(config)) 1 else 0)).W)

  /** Adds the parity to a record. */
  def withParity(config: ColonnadeConfig, record: UInt): UInt = if (hasParity(config)) record.xorR ## record else record
}

/** From a bank of the shared cache to the same bank of every column: a line that was read.
  *
  * The records of the line follow its announcement after three and four cycles. The next announcement comes two cycles
  * later, or later than that. A column that awaits the line takes it; no column can delay it.
  */
final class LineBroadcast(config: ColonnadeConfig) extends Bundle {
  val announced = Valid(UInt(Lines.lineBits(config).W)) // the line's number in its bank
  val record    = Lines.stored(config)
}

object LineBroadcast {
  val latency: Int = 3 // cycles from an announcement to the line's first record
}
