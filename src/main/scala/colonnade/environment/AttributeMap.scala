package colonnade.environment

import chisel3._
import chisel3.util.{Cat, MuxLookup, Pipe, RegEnable, Valid}
import colonnade.config.{AttributeLayout, ColonnadeConfig, MapEncoding, TileGrid}
import colonnade.formats.{BoundingPlaneEntry, Load, MapDescriptor, Plane}

final class AttributeMapIO[T <: Data](config: ColonnadeConfig, layout: TileGrid, entry: T, tagBits: Int)
    extends Bundle {
  val load   = Flipped(Valid(new Load(config))) // only while no request is in flight
  val pixels = Flipped(new AttributeChannel(new MapPixel(layout), entry, tagBits))
}

/** A map with an entry (a colour or a normal) for each pixel. Responses come in the order of the requests. */
abstract class AttributeMap[T <: Data](config: ColonnadeConfig, layout: TileGrid, entry: T, tagBits: Int)
    extends Module {
  final val io = IO(new AttributeMapIO(config, layout, entry, tagBits))
}

object AttributeMap {

  /** A map of the environment in the configured encoding.
    *
    * @param name of the map in [[colonnade.formats.AttributeMemories]]
    */
  def apply[T <: Data](config: ColonnadeConfig, name: String, entry: T, tagBits: Int): AttributeMap[T] = {
    val layout = AttributeLayout.of(config)
    layout.config.encoding match {
      case MapEncoding.TwoLevel => new TwoLevelMap(config, layout, name, entry, tagBits)
      case MapEncoding.Slic     => new SlicMap(config, layout, name, entry, tagBits)
    }
  }
}

/** A map of tiles with two or four palette entries each. A mask selects the entry of each cell; a cell's size depends
  * on the tile. See `MapDescriptor`.
  *
  * Three reads in sequence: descriptor, mask, palette. Latency six cycles, one pixel a cycle. A tile of four entries
  * has a word with two of them, which is read before the mask: its pixels take two cycles and a latency of seven. A
  * word beyond the heap is 0 and makes the response illegal; the mask's word is the last one of a tile.
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

/** A map of SLIC superpixels. Each tile has a seed. Each block of pixels, a sixteenth of a tile, has a label of four
  * bits, which selects one of the nine nearest seeds: 3 · (dy + 1) + (dx + 1). A word holds four labels, row by row
  * from the low bits. A label above 8 selects the tile's own seed; a seed outside the map is the nearest one inside.
  * Every content is legal.
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

  /** The tile's position along an axis, moved as the label says; an axis has `count` tiles, and a step along it changes
    * the label by `labelStep`.
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

final class PlaneMapIO(config: ColonnadeConfig, tagBits: Int) extends Bundle {
  private val layout = AttributeLayout.of(config)

  val load   = Flipped(Valid(new Load(config)))
  val cells  = Flipped(new AttributeChannel(new CellRequest(layout), new CellResponse(layout), tagBits))
  val planes = Flipped(new AttributeChannel(new PlaneRequest(layout), new BoundingPlaneEntry, tagBits))
}

/** The environment's planes. One channel gives the planes of a tile or cell, the other one a plane's coefficients;
  * neither waits for the other.
  */
final class PlaneMap(config: ColonnadeConfig, tagBits: Int) extends Module {
  val io = IO(new PlaneMapIO(config, tagBits))

  private val cells = Module(new CellLookup(config, tagBits))
  private val table = Module(new PlaneTable(config, tagBits))
  cells.io.load := io.load
  table.io.load := io.load
  io.cells <> cells.io.cells
  io.planes <> table.io.planes
}

final class PlaneTableIO(config: ColonnadeConfig, tagBits: Int) extends Bundle {
  val load   = Flipped(Valid(new Load(config)))
  val planes =
    Flipped(new AttributeChannel(new PlaneRequest(AttributeLayout.of(config)), new BoundingPlaneEntry, tagBits))
}

/** The coefficients of the map's planes and of the bounding planes. Latency one cycle, one plane a cycle. */
final class PlaneTable(config: ColonnadeConfig, tagBits: Int) extends Module {
  val io = IO(new PlaneTableIO(config, tagBits))

  private val table    = AttributeStore(config, "planes.planes", io.load)
  private val bounding = AttributeStore(config, "planes.bounding", io.load)
  private val req      = io.planes.req

  req.ready           := true.B
  table.read.valid    := req.valid && !req.bits.content.isBoundingPlane
  table.read.bits     := req.bits.content.index
  bounding.read.valid := req.valid && req.bits.content.isBoundingPlane
  bounding.read.bits  := req.bits.content.index

  private val isBoundingPlane = RegEnable(req.bits.content.isBoundingPlane, req.valid)
  private val entry           = bounding.word.asTypeOf(new BoundingPlaneEntry)
  io.planes.resp.valid              := RegNext(req.valid, false.B)
  io.planes.resp.bits.tag           := RegEnable(req.bits.tag, req.valid)
  io.planes.resp.bits.isIllegal     := false.B
  io.planes.resp.bits.content       := entry
  io.planes.resp.bits.content.plane := Mux(isBoundingPlane, entry.plane, table.word.asTypeOf(new Plane))
}
