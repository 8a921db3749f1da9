package colonnade.environment

import chisel3._
import chisel3.util.{Cat, MuxLookup, Pipe, RegEnable}
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.MapDescriptor

/** A map of tiles with two or four palette entries each, chosen by a mask with cells of the tile's own size; see
  * [[MapDescriptor]].
  *
  * Three reads follow each other: descriptor, mask, palette. Latency six cycles, one pixel a cycle. A tile of four
  * entries has a word with two of them, read just before the mask: its pixels take two cycles and a latency of seven.
  * Words beyond the heap are 0 and make the answer illegal; the mask's lies behind all others that a pixel needs.
  */
final class TwoLevelMap[T <: Data](config: ColonnadeConfig, name: String, entry: T, tagBits: Int)
    extends AttributeMap(config, entry, tagBits) {
  private val layout  = AttributeLayout.of(config)
  private val tiles   = Module(new TileLookup(config, s"$name.descriptors", new MapDescriptor, UInt(tagBits.W)))
  private val heap    = new AttributeHeap(config, s"$name.heap", io.load)
  private val palette = AttributeStore(config, s"$name.palette", io.load)

  // The tile
  tiles.io.load             := io.load
  tiles.io.pixel.valid      := io.pixels.question.valid
  tiles.io.pixel.bits.pixel := io.pixels.question.bits.content
  tiles.io.pixel.bits.rider := io.pixels.question.bits.tag
  io.pixels.question.ready  := tiles.io.pixel.ready

  // Its words: entries 2 and 3 where there are four, then the cell's
  private val isThere    = tiles.io.tile.valid
  private val tile       = tiles.io.tile.bits
  private val hasFour    = tile.descriptor.mode(2)
  private val cellSize   = tile.descriptor.mode(1, 0)
  private val cell       = MuxLookup(cellSize, 0.U)((0 to 3).map(size => size.U -> tile.cell(size + 1)))
  private val hasEntries = RegInit(false.B)
  private val isMask     = !hasFour || hasEntries
  private val maskWord   = Mux(hasFour, (cell >> 3) +& 1.U, cell >> 4)
  when(isThere) { hasEntries := !isMask }
  tiles.io.tile.ready := isMask
  heap.read(isThere && tile.descriptor.mode =/= 0.U, tile.descriptor.pointer +& Mux(isMask, maskWord, 0.U))

  // Choose the cell's entry
  private val read    = Pipe(isThere, tile)
  private val from    = read.bits.descriptor
  private val place   = RegEnable(cell(3, 0), isThere)
  private val isLast  = RegEnable(isMask, isThere)
  private val two     = RegEnable(heap.word, read.valid && !isLast)
  private val mask    = Mux(from.mode === 0.U, from.pointer, heap.word)
  private val ofTwo   = (mask >> place)(0)
  private val ofFour  = (mask >> Cat(place(2, 0), 0.U(1.W)))(1, 0)
  private val choice  = Mux(from.mode(2), ofFour, ofTwo)
  private val entries = from.entries ++ Seq(two(7, 0), two(15, 8))
  private val chosen  = Pipe(read.valid && isLast, VecInit(entries)(choice)(layout.paletteBits - 1, 0))

  // Look it up
  palette.read := chosen
  private val tag       = RegEnable(read.bits.rider, read.valid)
  private val isIllegal = RegEnable(heap.isIllegal, read.valid)
  io.pixels.answer.valid          := RegNext(chosen.valid, false.B)
  io.pixels.answer.bits.content   := palette.word.asTypeOf(entry)
  io.pixels.answer.bits.tag       := RegEnable(tag, chosen.valid)
  io.pixels.answer.bits.isIllegal := RegEnable(isIllegal, chosen.valid)
}
