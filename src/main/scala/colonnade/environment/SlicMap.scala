package colonnade.environment

import chisel3._
import chisel3.util.{Cat, Pipe, RegEnable}
import colonnade.config.{AttributeLayout, ColonnadeConfig}

/** A map of SLIC superpixels. Each tile has a seed. Each block of pixels, a sixteenth of a tile, has a label of four bits,
  * which selects one of the nine nearest seeds: 3 · (dy + 1) + (dx + 1). A word holds four labels, row by row from the low
  * bits. A label above 8 selects the tile's own seed; a seed outside the map is the nearest one inside. Every content is
  * legal.
  *
  * Two reads in sequence: label, seed. Latency five cycles, one pixel a cycle.
  *
  * @param name of the map in [[colonnade.formats.AttributeMemories]]
  */
final class SlicMap[T <: Data](config: ColonnadeConfig, layout: AttributeLayout, name: String, entry: T, tagBits: Int)
    extends AttributeMap(config, layout, entry, tagBits) {
  private val labels = AttributeStore(config, s"$name.labels", io.load)
  private val seeds  = AttributeStore(config, s"$name.seeds", io.load)
  private val pixel  = io.pixels.req.bits.content
  private val isReq  = io.pixels.req.valid

  io.pixels.req.ready := true.B
  assert(!isReq || (pixel.x < layout.mapWidth.U && pixel.y < layout.mapHeight.U), "a pixel outside the map")

  // The word with the block's label
  private val wordBits = labels.read.bits.getWidth
  private val block    =
    ((pixel.y >> layout.blockLog) * layout.blockColumns.U + (pixel.x >> layout.blockLog)).pad(wordBits + 2)
  private val blockReq = Pipe(isReq, io.pixels.req.bits)
  labels.read.valid := blockReq.valid
  labels.read.bits  := RegEnable(block(wordBits + 1, 2), isReq)

  // The seed that the label selects
  private val read    = Pipe(blockReq)
  private val slot    = RegEnable(RegEnable(block(1, 0), isReq), blockReq.valid)
  private val label   = (labels.word >> Cat(slot, 0.U(2.W)))(3, 0)
  private val column  = neighbour(read.bits.content.x >> layout.tileLog, layout.tileColumns, labelStep = 1)
  private val row     = neighbour(read.bits.content.y >> layout.tileLog, layout.tileRows, labelStep = 3)
  private val seedReq = Pipe(read)
  private val seed    = RegEnable(row, read.valid) * layout.tileColumns.U + RegEnable(column, read.valid)
  private val found   = Pipe(seedReq)
  seeds.read.valid := found.valid
  seeds.read.bits  := RegEnable(seed(layout.tileBits - 1, 0), seedReq.valid)

  io.pixels.resp.valid          := RegNext(found.valid, false.B)
  io.pixels.resp.bits.content   := seeds.word.asTypeOf(entry)
  io.pixels.resp.bits.tag       := RegEnable(found.bits.tag, found.valid)
  io.pixels.resp.bits.isIllegal := false.B

  /** The tile's position along an axis, moved as the label says; an axis has `count` tiles, and a step along it changes the
    * label by `labelStep`.
    */
  private def neighbour(position: UInt, count: Int, labelStep: Int): UInt = {
    def moves(by: Int): Bool = VecInit((0 until 16).map(l => (l <= 8 && l / labelStep % 3 - 1 == by).B))(label)
    Mux(
      moves(-1) && position =/= 0.U,
      position - 1.U,
      Mux(moves(1) && position =/= (count - 1).U, position + 1.U, position)
    )
  }
}
