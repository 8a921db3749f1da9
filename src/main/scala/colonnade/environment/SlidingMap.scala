package colonnade.environment

import chisel3._
import chisel3.util.{Pipe, RegEnable}
import colonnade.config.{AttributeLayout, ColonnadeConfig}

/** A map of SLIC superpixels. Each tile has one seed. Each block of pixels, a sixteenth of a tile, has a label of four
  * bits, which selects one of the nine nearest seeds: 3 · (dy + 1) + (dx + 1). A word holds four labels, row by row from
  * the low bits. A label above 8 selects the tile's own seed; a seed outside the map counts as the nearest one inside.
  *
  * Latency five cycles, one pixel a cycle.
  */
final class SlidingMap[T <: Data](config: ColonnadeConfig, name: String, entry: T, tagBits: Int)
    extends AttributeMap(config, AttributeLayout.of(config), entry, tagBits) {
  private val layout = AttributeLayout.of(config)
  private val labels = AttributeStore(config, s"$name.labels", io.load)
  private val seeds  = AttributeStore(config, s"$name.seeds", io.load)
  private val pixel  = io.pixels.req.bits.content
  private val isReq  = io.pixels.req.valid

  io.pixels.req.ready := true.B
  assert(!isReq || (pixel.x < layout.config.width.U && pixel.y < layout.config.height.U), "a pixel outside the map")

  // The block's label
  private val wordBits = labels.read.bits.getWidth
  private val block    =
    ((pixel.y >> layout.blockLog) * layout.blockColumns.U + (pixel.x >> layout.blockLog)).pad(wordBits + 2)
  private val labelWord = RegEnable(block(wordBits + 1, 2), isReq)
  private val blockReq  = Pipe(isReq, io.pixels.req.bits)
  labels.read.valid := blockReq.valid
  labels.read.bits  := labelWord

  // The seed that it selects
  private val read    = Pipe(blockReq)
  private val slot    = RegEnable(RegEnable(block(1, 0), isReq), blockReq.valid)
  private val label   = (labels.word >> (slot ## 0.U(2.W)))(3, 0)
  private val column  = neighbour(read.bits.content.x >> layout.tileLog, layout.tileColumns, step(label, 1))
  private val row     = neighbour(read.bits.content.y >> layout.tileLog, layout.tileRows, step(label, 3))
  private val seedReq = Pipe(read)
  private val seed    = RegEnable(row, read.valid) * layout.tileColumns.U + RegEnable(column, read.valid)
  private val found   = Pipe(seedReq)
  seeds.read.valid := found.valid
  seeds.read.bits  := RegEnable(seed(layout.tileBits - 1, 0), seedReq.valid)

  io.pixels.resp.valid          := RegNext(found.valid, false.B)
  io.pixels.resp.bits.content   := seeds.word.asTypeOf(entry)
  io.pixels.resp.bits.tag       := RegEnable(found.bits.tag, found.valid)
  io.pixels.resp.bits.isIllegal := false.B

  /** A label's direction along an axis: backward and forward. A step along x changes the label by 1, along y by 3. */
  private def step(label: UInt, weight: Int): (Bool, Bool) = {
    def goes(by: Int): Bool = VecInit((0 until 16).map(l => (l <= 8 && l / weight % 3 - 1 == by).B))(label)
    (goes(-1), goes(1))
  }

  private def neighbour(position: UInt, count: Int, step: (Bool, Bool)): UInt = {
    val (isBackward, isForward) = step
    Mux(
      isBackward && position =/= 0.U,
      position - 1.U,
      Mux(isForward && position =/= (count - 1).U, position + 1.U, position)
    )
  }
}
