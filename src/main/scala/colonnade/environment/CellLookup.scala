package colonnade.environment

import chisel3._
import chisel3.util.{Cat, Pipe, RegEnable, Valid}
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{Load, PlaneDescriptor}

/** Ports of [[CellLookup]]. */
final class CellLookupIO(config: ColonnadeConfig, tagBits: Int) extends Bundle {
  private val layout = AttributeLayout.of(config)

  val load  = Flipped(Valid(new Load(config)))
  val cells = Flipped(new AttributeChannel(new CellRequest(layout), new CellResponse(layout), tagBits))
}

/** Looks up the planes of a pixel's tile, or the plane of its cell; see `PlaneDescriptor`. A mode beyond 4 counts as 0.
  *
  * A tile has consecutive words: two plane ids per word, then the cells' mask. Latency five cycles and one request a cycle
  * if it needs at most one word. Each further word takes one cycle; the most are three words, for a cell of four planes.
  * A word beyond the heap is 0 and makes the response illegal; the last word that is read decides.
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

  // Its words, one a cycle
  private val isValid  = tiles.io.tile.valid
  private val tile     = tiles.io.tile.bits
  private val kind     = TileKind(tile.descriptor.mode)
  private val cell     = Mux(kind.isFine, tile.cell(3), tile.cell(2))
  private val step     = RegInit(0.U(2.W))
  private val idWords  = Mux(kind.hasFour, 2.U, 1.U)
  private val isMask   = !kind.isFlat && step === idWords
  private val isLast   = kind.isFlat || step === Mux(tile.sideband.wholeTile, idWords - 1.U, idWords)
  private val maskWord = Mux(kind.hasFour, cell >> 3, cell >> 4)
  when(isValid) { step := Mux(isLast, 0.U, step + 1.U) }
  tiles.io.tile.ready := isLast
  heap.read(isValid && !kind.isFlat, tile.descriptor.pointer +& Mux(isMask, idWords +& maskWord, step))

  // The ids that have been read
  private val read    = Pipe(isValid, tile)
  private val from    = RegEnable(kind, isValid)
  private val wasMask = RegEnable(isMask, isValid)
  private val wasStep = RegEnable(step(0), isValid)
  private val isDone  = RegEnable(isLast, isValid)
  private val index   = RegEnable(cell(3, 0), isValid)
  private val known   = Reg(Vec(4, UInt(AttributeLayout.indexBits.W)))
  private val ids     = WireInit(known)
  for (i <- 0 until 4; isRead = !wasMask && wasStep === (i / 2).U)
    when(isRead) { ids(i) := (if (i % 2 == 0) heap.word(7, 0) else heap.word(15, 8)) }
  when(read.valid) { known := ids }

  // The response
  private val choice = Mux(from.hasFour, (heap.word >> Cat(index(2, 0), 0.U(1.W)))(1, 0), (heap.word >> index)(0))
  private val isOne  = from.isFlat || !read.bits.sideband.wholeTile
  private val count  = Mux(isOne, 1.U, Mux(from.hasFour, 4.U, 2.U))
  private val resp   = Wire(new TaggedResponse(new CellResponse(layout), tagBits))
  resp.tag             := read.bits.sideband.tag
  resp.isIllegal       := heap.isIllegal
  resp.content.count   := count
  resp.content.cellLog := layout.tileLog.U - Mux(from.isFlat, 0.U, Mux(from.isFine, 3.U, 2.U))
  resp.content.ids     := VecInit(ids.zipWithIndex.map { case (id, i) => Mux(count > i.U, id, 0.U) })
  when(from.isFlat) { resp.content.ids(0) := read.bits.descriptor.pointer }
    .elsewhen(isOne) { resp.content.ids(0) := ids(choice) }
  io.cells.resp := Pipe(read.valid && isDone, resp)
}

/** A decoded tile mode. */
private final class TileKind extends Bundle {

  /** The tile has one plane. */
  val isFlat = Bool()

  /** The tile has four planes, not two. */
  val hasFour = Bool()

  /** A cell's edge is an eighth of the tile's, not a quarter. */
  val isFine = Bool()
}

private object TileKind {
  def apply(mode: UInt): TileKind = {
    val kind = Wire(new TileKind)
    kind.isFlat  := mode === 0.U || mode > 4.U
    kind.hasFour := mode > 2.U
    kind.isFine  := !mode(0)
    kind
  }
}
