package colonnade.environment

import chisel3._
import chisel3.util.{Pipe, RegEnable}
import colonnade.config.{AttributeLayout, ColonnadeConfig}

/** A map of SLIC superpixels: one seed a tile, and for each block of pixels, a sixteenth of a tile, a label of four bits
  * that says which of the nine seeds around it belongs to: 3 · (dy + 1) + (dx + 1), four labels a word, row by row from
  * the low bits. A label above 8 is that of the tile itself; a seed outside the map is the nearest one inside.
  *
  * Latency five cycles, one pixel a cycle.
  */
final class SlidingMap[T <: Data](config: ColonnadeConfig, name: String, entry: T, tagBits: Int)
    extends AttributeMap(config, entry, tagBits) {
  private val layout = AttributeLayout.of(config)
  private val labels = AttributeStore(config, s"$name.labels", io.load)
  private val seeds  = AttributeStore(config, s"$name.seeds", io.load)
  private val pixel  = io.pixels.question.bits.content
  private val asks   = io.pixels.question.valid

  io.pixels.question.ready := true.B
  assert(!asks || (pixel.x < layout.config.width.U && pixel.y < layout.config.height.U), "a pixel outside the map")

  // The block's label
  private val wordBits = labels.read.bits.getWidth
  private val block    =
    ((pixel.y >> layout.blockLog) * layout.blockColumns.U + (pixel.x >> layout.blockLog)).pad(wordBits + 2)
  private val labelWord = RegEnable(block(wordBits + 1, 2), asks)
  private val asked     = Pipe(asks, io.pixels.question.bits)
  labels.read.valid := asked.valid
  labels.read.bits  := labelWord

  // The seed that it names
  private val read   = Pipe(asked)
  private val slot   = RegEnable(RegEnable(block(1, 0), asks), asked.valid)
  private val label  = (labels.word >> (slot ## 0.U(2.W)))(3, 0)
  private val column = neighbour(read.bits.content.x >> layout.tileLog, layout.tileColumns, step(label, 1))
  private val row    = neighbour(read.bits.content.y >> layout.tileLog, layout.tileRows, step(label, 3))
  private val named  = Pipe(read)
  private val seed   = RegEnable(row, read.valid) * layout.tileColumns.U + RegEnable(column, read.valid)
  private val found  = Pipe(named)
  seeds.read.valid := found.valid
  seeds.read.bits  := RegEnable(seed(layout.tileBits - 1, 0), named.valid)

  io.pixels.answer.valid          := RegNext(found.valid, false.B)
  io.pixels.answer.bits.content   := seeds.word.asTypeOf(entry)
  io.pixels.answer.bits.tag       := RegEnable(found.bits.tag, found.valid)
  io.pixels.answer.bits.isIllegal := false.B

  /** Which way a label leads along an axis: back and forth. The labels of the x axis differ by 1, those of the y axis by
    * 3.
    */
  private def step(label: UInt, weight: Int): (Bool, Bool) = {
    def leads(way: Int): Bool = VecInit((0 until 16).map(l => (l <= 8 && l / weight % 3 - 1 == way).B))(label)
    (leads(-1), leads(1))
  }

  private def neighbour(place: UInt, count: Int, step: (Bool, Bool)): UInt = {
    val (isBack, isForth) = step
    Mux(isBack && place =/= 0.U, place - 1.U, Mux(isForth && place =/= (count - 1).U, place + 1.U, place))
  }
}
