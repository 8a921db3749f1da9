package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.config.{ColonnadeConfig, ShellConfig}

/** A row of a tile as beats of the bus, the first in the low bits.
  *
  * @param count  beats
  * @param len    beats less one
  * @param data   a row that is narrower than the bus is repeated in all lanes
  * @param strobe bytes that are there; of a narrow row in the lane of its address
  */
final case class RowBeats(count: UInt, len: UInt, data: UInt, strobe: UInt)

object RowBeats {

  /** @param address of the row, a multiple of its size */
  def apply(config: ColonnadeConfig, shell: ShellConfig, format: UInt, row: TileRow, address: UInt): RowBeats = {
    val tileSize = config.frame.tileSize
    val bus      = shell.busBytes
    val width    = (tileSize * PixelFormat.maxBytes).max(bus)
    val bytesLog = PixelFormat.bytesLog(format)
    val formats  = Seq(1, 2, 3).map(log => (bytesLog === log.U) -> (1 << log))

    def ofFormat(value: Int => UInt): UInt = Mux1H(formats.map { case (is, bytes) => is -> value(bytes) })
    def data(bytes: Int): UInt             = {
      val packed = Cat(row.pixels.reverse.map(_(8 * bytes - 1, 0)))
      if (packed.getWidth < 8 * bus) Fill(8 * bus / packed.getWidth, packed) else packed.pad(8 * width)
    }
    def strobe(bytes: Int): UInt = {
      val size = tileSize * bytes
      val lane = if (size < bus) address(log2Ceil(bus) - 1, log2Ceil(size)) * size.U else 0.U
      row.mask.asBools.map(Fill(bytes, _)).reduceRight((low, high) => high ## low) << lane
    }
    def count(bytes: Int): Int = (tileSize * bytes / bus).max(1)
    RowBeats(ofFormat(count(_).U), ofFormat(bytes => (count(bytes) - 1).U), ofFormat(data), ofFormat(strobe))
  }
}
