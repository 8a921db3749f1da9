package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.config.{ColonnadeConfig, ShellConfig}

/** A tile's pixels in one line of the frame.
  *
  * @param wordBits of a pixel: those of its format, or of a [[PixelWord]]
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
  * A row leaves when it is whole, when another one needs its place, or at `flush`. A pixel enters per cycle; a row leaves
  * in three. With `units.shortPaths` a pixel enters every second cycle: in the first one it is compared with the rows.
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

  // A pixel joins its row, or begins one
  private val tag     = (pixels.bits.x >> tileBits) ## pixels.bits.y
  private val matches = VecInit(tags.map(_ === tag))
  private val isNew   = RegInit(true.B) // the pixel was not compared yet
  private val mayJoin = if (config.units.shortPaths) !isNew else true.B
  private val hits    = VecInit(
    valid.zip(if (config.units.shortPaths) RegNext(matches) else matches).map { case (isValid, is) => isValid && is }
  )
  if (config.units.shortPaths) isNew := !pixels.valid || pixels.fire
  private val isHit   = hits.asUInt.orR
  private val hasFree = !valid.asUInt.andR
  private val row     = Mux(isHit, OHToUInt(hits), PriorityEncoder(~valid.asUInt))
  private val column  = UIntToOH(pixels.bits.x(tileBits - 1, 0), config.frame.tileSize)
  pixels.ready := mayJoin && (isHit || hasFree)
  when(pixels.fire) {
    if (config.units.shortPaths) {
      for ((isRow, index) <- Mux(isHit, hits.asUInt, PriorityEncoderOH(~valid.asUInt)).asBools.zipWithIndex)
        when(isRow) {
          valid(index) := true.B
          tags(index)  := tag
          masks(index) := Mux(isHit, masks(index), 0.U) | column
        }
    } else {
      valid(row) := true.B
      tags(row)  := tag
      masks(row) := Mux(isHit, masks(row), 0.U) | column
    }
    data.write(row, VecInit.fill(config.frame.tileSize)(pixels.bits.data), column.asBools)
  }

  // A row leaves
  private val isReading = RegInit(false.B)
  private val isOut     = RegInit(false.B)
  private val leaving   = Reg(chiselTypeOf(out.bits))
  private val whole     = VecInit(valid.zip(masks).map { case (isValid, mask) =>
    val isWhole = isValid && mask.andR
    if (config.units.shortPaths) isValid && RegNext(isWhole, false.B) else isWhole
  }).asUInt
  private val victim = RegInit(0.U(log2Ceil(shell.rows).W))
  // With short paths rows are chosen in the cycle before: no other one leaves then
  private val isForced  = before(pixels.valid && mayJoin && !isHit && !hasFree)
  private val hasWhole  = before(whole.orR)
  private val isFlushed = flush && !pixels.valid && before(valid.asUInt.orR)
  private val evicted   =
    Mux(hasWhole, chosen(whole), Mux(isForced, victim, chosen(valid.asUInt)))
  private val evicts = !isReading && !isOut && (hasWhole || isForced || isFlushed)
  private val read   = data.read(evicted, evicts)
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
  isIdle    := !valid.asUInt.orR && !isReading && !isOut

  private def before(value: Bool): Bool = if (config.units.shortPaths) RegNext(value, false.B) else value

  private def chosen(rows: UInt): UInt = {
    val first = PriorityEncoder(rows)
    if (config.units.shortPaths) RegNext(first) else first
  }
}
