package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.common.TimingSlice
import colonnade.config.{ColonnadeConfig, ShellConfig}

/** A tile's pixels in one line of the frame.
  *
  * @param wordBits of a pixel: of its format, or of a [[PixelWord]]
  */
final class TileRow(config: ColonnadeConfig, wordBits: Int = 8 * PixelFormat.maxBytes) extends Bundle {

  /** Number of the tile in its line, and of the line. */
  val tile = UInt((config.numbers.coordinateBits - log2Ceil(config.frame.tileSize)).W)
  val y    = UInt(config.numbers.coordinateBits.W)

  /** Pixels that are there, the leftmost in bit 0. */
  val mask   = UInt(config.frame.tileSize.W)
  val pixels = Vec(config.frame.tileSize, UInt(wordBits.W))
}

/** Gathers the pixels of a column, which come in any order, to rows of a tile: a write-combining buffer.
  *
  * A row leaves when it is whole, when another one needs its place, or at `flush`. A pixel enters per cycle, in three
  * cycles: it is compared with the rows, joins one, and is written. A row leaves in three, and is chosen in the cycle
  * before.
  */
final class RowBuffer(config: ColonnadeConfig, shell: ShellConfig) extends Module {
  private val tileBits = log2Ceil(config.frame.tileSize)

  val pixels = IO(Flipped(Decoupled(new EncodedPixel(config))))
  val out    = IO(Decoupled(new TileRow(config, PixelWord.bits(config))))

  /** No pixel will come; until idle. */
  val flush  = IO(Input(Bool()))
  val isIdle = IO(Output(Bool()))

  private val valid = RegInit(VecInit.fill(shell.rows)(false.B))
  private val tags  = Reg(Vec(shell.rows, UInt((pixels.bits.x.getWidth - tileBits + pixels.bits.y.getWidth).W)))
  private val masks = Reg(Vec(shell.rows, UInt(config.frame.tileSize.W)))
  private val data  = SyncReadMem(shell.rows, chiselTypeOf(out.bits.pixels))

  // A pixel is compared with the rows as they are in the next cycle, when it joins its row or begins one
  private def tagOf(pixel: EncodedPixel): UInt = (pixel.x >> tileBits) ## pixel.y
  private val hasPixel                         = RegInit(false.B)
  private val pixel                            = RegEnable(pixels.bits, pixels.fire)
  private val joins                            = Wire(UInt(shell.rows.W)) // the row that takes `pixel` in this cycle
  private val matches                          = tags.zip(joins.asBools).map { case (tag, isTaken) =>
    RegEnable(tagOf(pixels.bits) === Mux(isTaken, tagOf(pixel), tag), pixels.fire)
  }
  private val hits    = VecInit(valid.zip(matches).map { case (isValid, isMatch) => isValid && isMatch }).asUInt
  private val isHit   = hits.orR
  private val hasFree = !valid.asUInt.andR
  private val column  = UIntToOH(pixel.x(tileBits - 1, 0), config.frame.tileSize)
  joins        := Mux(hasPixel, Mux(isHit, hits, PriorityEncoderOH(~valid.asUInt)), 0.U)
  pixels.ready := !hasPixel || isHit || hasFree
  when(pixels.ready) { hasPixel := pixels.valid }
  for ((isTaken, index) <- joins.asBools.zipWithIndex) when(isTaken) {
    valid(index) := true.B
    tags(index)  := tagOf(pixel)
    masks(index) := Mux(isHit, masks(index), 0.U) | column
  }
  private val isWriting = TimingSlice.flag(joins.orR)
  private val columns   = TimingSlice(column)
  private val written   = VecInit.fill(config.frame.tileSize)(TimingSlice(pixel.data))
  when(isWriting) { data.write(TimingSlice(OHToUInt(joins)), written, columns.asBools) }

  // A row leaves. It is chosen in the cycle before: no other one leaves then
  private val isReading = RegInit(false.B)
  private val isOut     = RegInit(false.B)
  private val leaving   = Reg(chiselTypeOf(out.bits))
  private val whole     = VecInit(valid.zip(masks).map { case (isValid, mask) =>
    isValid && TimingSlice.flag(isValid && mask.andR)
  }).asUInt
  private val victim    = RegInit(0.U(log2Ceil(shell.rows).W))
  private val isForced  = TimingSlice.flag(hasPixel && !isHit && !hasFree)
  private val hasWhole  = TimingSlice.flag(whole.orR)
  private val isFlushed = flush && !pixels.valid && !hasPixel && !isWriting && TimingSlice.flag(valid.asUInt.orR)
  private val firstOf   = (rows: UInt) => TimingSlice(PriorityEncoder(rows))
  private val evicted   = Mux(hasWhole, firstOf(whole), Mux(isForced, victim, firstOf(valid.asUInt)))
  private val evicts    = !isReading && !isOut && (hasWhole || isForced || isFlushed)
  private val read      = data.read(evicted, evicts)
  isReading := evicts
  when(evicts) {
    valid(evicted) := false.B
    leaving.tile   := tags(evicted) >> pixels.bits.y.getWidth
    leaving.y      := tags(evicted)
    leaving.mask   := masks(evicted)
    when(!hasWhole) { victim := victim + 1.U }
  }
  when(isReading) {
    leaving.pixels := read
    isOut          := true.B
  }
  when(out.fire) { isOut := false.B }
  out.valid := isOut
  out.bits  := leaving
  isIdle    := !hasPixel && !valid.asUInt.orR && !isReading && !isOut
}

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
