package colonnade.environment

import chisel3._
import chisel3.util.{Cat, Pipe, RegEnable, Valid}
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{Load, PlaneDescriptor}

/** Ports of [[CellLookup]]. */
final class CellLookupIO(config: ColonnadeConfig, tagBits: Int) extends Bundle {
  private val layout = AttributeLayout.of(config)

  val load  = Flipped(Valid(new Load(config)))
  val cells = Flipped(new AttributeChannel(new CellQuestion(layout), new CellAnswer(layout), tagBits))
}

/** Finds the planes of a pixel's tile, or the one of its cell; see [[PlaneDescriptor]]. A mode beyond 4 is read as 0.
  *
  * A tile's words follow each other: its ids, two a word, and for a cell the mask's. Latency five cycles and one tile a
  * cycle where there is at most one word; each further one takes a cycle more: at most three words, for a cell of four
  * planes. Words beyond the heap are 0 and make the answer illegal; the last one that is read tells for all.
  */
final class CellLookup(config: ColonnadeConfig, tagBits: Int) extends Module {
  val io = IO(new CellLookupIO(config, tagBits))

  /** What goes along with a pixel. */
  private class Rider extends Bundle {
    val wholeTile = Bool()
    val tag       = UInt(tagBits.W)
  }

  private val layout   = AttributeLayout.of(config)
  private val tiles    = Module(new TileLookup(config, "planes.descriptors", new PlaneDescriptor, new Rider))
  private val heap     = new AttributeHeap(config, "planes.heap", io.load)
  private val question = io.cells.question

  // The tile
  tiles.io.load                       := io.load
  tiles.io.pixel.valid                := question.valid
  tiles.io.pixel.bits.pixel           := question.bits.content.pixel
  tiles.io.pixel.bits.rider.wholeTile := question.bits.content.wholeTile
  tiles.io.pixel.bits.rider.tag       := question.bits.tag
  question.ready                      := tiles.io.pixel.ready

  // Its words, one a cycle
  private val isThere  = tiles.io.tile.valid
  private val tile     = tiles.io.tile.bits
  private val kind     = TileKind(tile.descriptor.mode)
  private val cell     = Mux(kind.isFine, tile.cell(3), tile.cell(2))
  private val step     = RegInit(0.U(2.W))
  private val idWords  = Mux(kind.hasFour, 2.U, 1.U)
  private val isMask   = !kind.isFlat && step === idWords
  private val isLast   = kind.isFlat || step === Mux(tile.rider.wholeTile, idWords - 1.U, idWords)
  private val maskWord = Mux(kind.hasFour, cell >> 3, cell >> 4)
  when(isThere) { step := Mux(isLast, 0.U, step + 1.U) }
  tiles.io.tile.ready := isLast
  heap.read(isThere && !kind.isFlat, tile.descriptor.pointer +& Mux(isMask, idWords +& maskWord, step))

  // The ids so far
  private val read    = Pipe(isThere, tile)
  private val from    = RegEnable(kind, isThere)
  private val wasMask = RegEnable(isMask, isThere)
  private val wasStep = RegEnable(step(0), isThere)
  private val isDone  = RegEnable(isLast, isThere)
  private val place   = RegEnable(cell(3, 0), isThere)
  private val known   = Reg(Vec(4, UInt(AttributeLayout.indexBits.W)))
  private val ids     = WireInit(known)
  for (i <- 0 until 4; isRead = !wasMask && wasStep === (i / 2).U)
    when(isRead) { ids(i) := (if (i % 2 == 0) heap.word(7, 0) else heap.word(15, 8)) }
  when(read.valid) { known := ids }

  // The answer
  private val choice = Mux(from.hasFour, (heap.word >> Cat(place(2, 0), 0.U(1.W)))(1, 0), (heap.word >> place)(0))
  private val isOne  = from.isFlat || !read.bits.rider.wholeTile
  private val count  = Mux(isOne, 1.U, Mux(from.hasFour, 4.U, 2.U))
  private val answer = Wire(new Answered(new CellAnswer(layout), tagBits))
  answer.tag             := read.bits.rider.tag
  answer.isIllegal       := heap.isIllegal
  answer.content.count   := count
  answer.content.cellLog := layout.tileLog.U - Mux(from.isFlat, 0.U, Mux(from.isFine, 3.U, 2.U))
  answer.content.ids     := VecInit(ids.zipWithIndex.map { case (id, i) => Mux(count > i.U, id, 0.U) })
  when(from.isFlat) { answer.content.ids(0) := read.bits.descriptor.pointer }
    .elsewhen(isOne) { answer.content.ids(0) := ids(choice) }
  io.cells.answer := Pipe(read.valid && isDone, answer)
}

/** What a tile's mode says. */
private final class TileKind extends Bundle {

  /** All in one plane. */
  val isFlat = Bool()

  /** Four planes, not two. */
  val hasFour = Bool()

  /** Cells of an eighth of the tile's edge, not a quarter. */
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
