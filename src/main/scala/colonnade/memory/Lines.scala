package colonnade.memory

import chisel3._
import chisel3.util.{log2Ceil, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RecordFormats, SceneLines}

/** A line is four consecutive records. Line n lies in bank n mod `banks`, as number n / `banks` of that bank. */
object Lines {
  val records:  Int = SceneLines.records
  val wordBits: Int = log2Ceil(records)

  /** Width of the number of a line in its bank. */
  def lineBits(config: ColonnadeConfig): Int =
    RecordFormats.addressBits(config) - wordBits - log2Ceil(config.columnBvhMemory.banks)
}

/** From a bank of the shared cache to the same bank of every column: a line that was read.
  *
  * The records of the line follow its announcement after three to six cycles, one per cycle. The next announcement comes
  * four cycles later, or later than that. A column that awaits the line takes it; no column can delay it.
  */
final class LineBroadcast(config: ColonnadeConfig) extends Bundle {

  /** The line's number in its bank. */
  val announced = Valid(UInt(Lines.lineBits(config).W))
  val record    = new RecordFormats(config).record
}

object LineBroadcast {

  /** Cycles from an announcement to the line's first record. */
  val latency: Int = 3
}
