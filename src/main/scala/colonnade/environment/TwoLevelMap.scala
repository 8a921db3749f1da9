package colonnade.environment

import chisel3._
import chisel3.util.{Cat, MuxLookup, Pipe, RegEnable}
import colonnade.config.{ColonnadeConfig, TileGrid}
import colonnade.formats.MapDescriptor

/** A map of tiles with two or four palette entries each. A mask selects the entry of each cell; a cell's size depends on
  * the tile. See `MapDescriptor`.
  *
  * Three reads in sequence: descriptor, mask, palette. Latency six cycles, one pixel a cycle. A tile of four entries has a
  * word with two of them, which is read before the mask: its pixels take two cycles and a latency of seven. A word beyond
  * the heap is 0 and makes the response illegal; the mask's word is the last one of a tile.
  *
  * @param name of the map in [[colonnade.formats.AttributeMemories]]
  */
final class TwoLevelMap[T <: Data](config: ColonnadeConfig, layout: TileGrid, name: String, entry: T, tagBits: Int)
    extends AttributeMap(config, layout, entry, tagBits) {
  private val tiles   = Module(new TileLookup(config, layout, s"$name.descriptors", new MapDescriptor, UInt(tagBits.W)))
  private val heap    = new AttributeHeap(config, s"$name.heap", io.load)
  private val palette = AttributeStore(config, s"$name.palette", io.load)

  // The tile
  tiles.io.load                := io.load
  tiles.io.pixel.valid         := io.pixels.req.valid
  tiles.io.pixel.bits.pixel    := io.pixels.req.bits.content
  tiles.io.pixel.bits.sideband := io.pixels.req.bits.tag
  io.pixels.req.ready          := tiles.io.pixel.ready

  // Its words: entries 2 and 3 of a tile of four, then the mask's word
  private val isValid    = tiles.io.tile.valid
  private val tile       = tiles.io.tile.bits
  private val hasFour    = tile.descriptor.mode(2)
  private val cellSize   = tile.descriptor.mode(1, 0)
  private val cell       = MuxLookup(cellSize, 0.U)((0 to 3).map(size => size.U -> tile.cell(size + 1)))
  private val hasEntries = RegInit(false.B)
  private val isMask     = !hasFour || hasEntries
  private val maskWord   = Mux(hasFour, (cell >> 3) +& 1.U, cell >> 4)
  when(isValid) { hasEntries := !isMask }
  tiles.io.tile.ready := isMask
  heap.read(isValid && tile.descriptor.mode =/= 0.U, tile.descriptor.pointer +& Mux(isMask, maskWord, 0.U))

  // Select the cell's entry
  private val read    = Pipe(isValid, tile)
  private val from    = read.bits.descriptor
  private val index   = RegEnable(cell(3, 0), isValid)
  private val isLast  = RegEnable(isMask, isValid)
  private val two     = RegEnable(heap.word, read.valid && !isLast)
  private val mask    = Mux(from.mode === 0.U, from.pointer, heap.word)
  private val ofTwo   = (mask >> index)(0)
  private val ofFour  = (mask >> Cat(index(2, 0), 0.U(1.W)))(1, 0)
  private val choice  = Mux(from.mode(2), ofFour, ofTwo)
  private val entries = from.entries ++ Seq(two(7, 0), two(15, 8))
  private val chosen  = Pipe(read.valid && isLast, VecInit(entries)(choice)(layout.paletteBits - 1, 0))

  // Look up the entry
  palette.read := chosen
  private val tag       = RegEnable(read.bits.sideband, read.valid)
  private val isIllegal = RegEnable(heap.isIllegal, read.valid)
  io.pixels.resp.valid          := RegNext(chosen.valid, false.B)
  io.pixels.resp.bits.content   := palette.word.asTypeOf(entry)
  io.pixels.resp.bits.tag       := RegEnable(tag, chosen.valid)
  io.pixels.resp.bits.isIllegal := RegEnable(isIllegal, chosen.valid)
}
