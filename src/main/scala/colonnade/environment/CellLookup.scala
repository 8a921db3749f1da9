package colonnade.environment

import chisel3._
import chisel3.util.{Cat, Pipe, RegEnable, Valid}
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{Load, PlaneDescriptor}

final class CellLookupIO(config: ColonnadeConfig, tagBits: Int) extends Bundle {
  private val layout = AttributeLayout.of(config)

  val load  = Flipped(Valid(new Load(config)))
  val cells = Flipped(new AttributeChannel(new CellRequest(layout), new CellResponse(layout), tagBits))
}

/** Looks up the planes of a pixel's tile, or the plane of its cell; see `PlaneDescriptor`. Mode 7 counts as 0.
  *
  * A tile has consecutive words: two plane ids per word, then the cells' mask. A tile's ids are read word by word. For
  * a cell its mask is read first, and then the word with the id that the mask selects. So each request takes two cycles
  * at most, and columns that share the memory can count on that. Latency five cycles and one request a cycle if it
  * needs at most one word; one cycle more for a second word. A word beyond the heap is 0 and makes the response
  * illegal; the highest address decides: of a tile's last word, or of a cell's mask.
  */
final class CellLookup(config: ColonnadeConfig, tagBits: Int) extends Module {
  val io = IO(new CellLookupIO(config, tagBits))

  /** Passes through the tile look-up with the pixel. */
  private class Sideband extends Bundle {
    val wholeTile = Bool()
    val tag       = UInt(tagBits.W)
  }

  private val layout = AttributeLayout.of(config)
  private val tiles  = Module(new TileLookup(config, layout, "planes.descriptors", new PlaneDescriptor, new Sideband))
  private val heap   = new AttributeHeap(config, "planes.heap", io.load)
  private val req    = io.cells.req

  // The tile
  tiles.io.load                          := io.load
  tiles.io.pixel.valid                   := req.valid
  tiles.io.pixel.bits.pixel              := req.bits.content.pixel
  tiles.io.pixel.bits.sideband.wholeTile := req.bits.content.wholeTile
  tiles.io.pixel.bits.sideband.tag       := req.bits.tag
  req.ready                              := tiles.io.pixel.ready

  // Its words, one a cycle: ids in sequence, or the mask and then the word with the id that it selects
  private val isValid  = tiles.io.tile.valid
  private val tile     = tiles.io.tile.bits
  private val kind     = TileKind(tile.descriptor.mode)
  private val isCell   = !kind.isFlat && !tile.sideband.wholeTile
  private val cell     = Mux(kind.isFinest, tile.cell(4), Mux(kind.isFine, tile.cell(3), tile.cell(2)))
  private val isSecond = RegInit(false.B)
  private val isLast   = isSecond || !(isCell || kind.hasFour)
  private val maskWord = Mux(kind.hasFour, (cell >> 3) +& 2.U, (cell >> 4) +& 1.U)
  private val selected =
    Mux(kind.hasFour, (heap.word >> Cat(cell(2, 0), 0.U(1.W)))(1, 0), (heap.word >> cell(3, 0))(0))
  private val idWord = Mux(isCell, selected(1), isSecond)
  when(isValid) { isSecond := !isLast }
  tiles.io.tile.ready := isLast
  heap.read(isValid && !kind.isFlat, tile.descriptor.pointer +& Mux(isCell && !isSecond, maskWord, idWord))

  // What has been read in the cycle before, and one cycle earlier
  private val read        = Pipe(isValid, tile)
  private val from        = RegEnable(kind, isValid)
  private val wasCell     = RegEnable(isCell, isValid)
  private val wasSecond   = RegEnable(isSecond, isValid)
  private val isDone      = RegEnable(isLast, isValid)
  private val choice      = RegEnable(selected(0), isValid)
  private val illegalMask = RegNext(heap.isIllegal)
  private val earlier     = RegEnable(heap.word, read.valid)
  private val first       = Mux(wasSecond, earlier, heap.word)

  // The response
  private val count = Mux(from.isFlat || wasCell, 1.U, Mux(from.hasFour, 4.U, 2.U))
  private val resp  = Wire(new TaggedResponse(new CellResponse(layout), tagBits))
  resp.tag             := read.bits.sideband.tag
  resp.isIllegal       := Mux(wasCell, illegalMask, heap.isIllegal)
  resp.content.count   := count
  resp.content.cellLog := layout.tileLog.U - Mux(from.isFlat, 0.U, Mux(from.isFinest, 4.U, Mux(from.isFine, 3.U, 2.U)))
  resp.content.ids     := VecInit(Seq(first(7, 0), first(15, 8), heap.word(7, 0), heap.word(15, 8)).zipWithIndex.map {
    case (id, i) => Mux(count > i.U, id, 0.U)
  })
  when(from.isFlat) { resp.content.ids(0) := read.bits.descriptor.pointer }
    .elsewhen(wasCell) { resp.content.ids(0) := Mux(choice, heap.word(15, 8), heap.word(7, 0)) }
  io.cells.resp := Pipe(read.valid && isDone, resp)
}

/** A decoded tile mode. */
private final class TileKind extends Bundle {
  val isFlat   = Bool() // the tile has one plane
  val hasFour  = Bool() // the tile has four planes, not two
  val isFinest = Bool() // a cell's edge is a sixteenth of the tile's
  val isFine   = Bool() // otherwise, an eighth, not a quarter
}

private object TileKind {
  def apply(mode: UInt): TileKind = {
    val kind = Wire(new TileKind)
    kind.isFlat   := mode === 0.U || mode === 7.U
    kind.hasFour  := mode === 3.U || mode === 4.U || mode === 6.U
    kind.isFinest := mode > 4.U
    kind.isFine   := !mode(0)
    kind
  }
}

/** Requests the planes of tiles, and the plane of cells. The next tile or cell of the ray is requested as soon as the
  * current one is known. Illegal responses count if the ray comes to their tile.
  */
final class CellReader(m: MarchOperations, maps: AttributeChannel[CellRequest, CellResponse]) {
  import m.formats.layout

  val channel = new Lookahead(maps, (response: TaggedResponse[CellResponse]) => response)

  /** A response that is taken in this cycle is illegal. */
  val isIllegal: Bool = WireInit(false.B)

  /** The response that can be taken. */
  val content: CellResponse = channel.response.content

  def isInMap(tile: Seq[UInt]): Bool = tile(0) < layout.tileColumns.U && tile(1) < layout.tileRows.U

  /** Requests all planes of a tile, which is in the map. */
  def requestTile(tile: Seq[UInt]): Unit = channel.make { (request: CellRequest) =>
    request.pixel     := CellReader.corner(layout, tile)
    request.wholeTile := true.B
  }

  /** Requests the plane of a pixel's cell. */
  def requestCell(pixel: MapPixel): Unit = channel.make { (request: CellRequest) =>
    request.pixel     := pixel
    request.wholeTile := false.B
  }

  /** Takes the response. */
  def take(): Unit = {
    channel.take()
    isIllegal := channel.response.isIllegal
  }
}

private[environment] object CellReader {

  /** A tile's first pixel. */
  def corner(layout: AttributeLayout, tile: Seq[UInt]): MapPixel =
    pixel(layout, tile.map(tile => (tile << layout.tileLog).asUInt))

  def pixel(layout: AttributeLayout, position: Seq[UInt]): MapPixel = {
    val pixel = Wire(new MapPixel(layout))
    pixel.x := position(0)
    pixel.y := position(1)
    pixel
  }
}
