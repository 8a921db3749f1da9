package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.axi.{Axi, AxiReadPort}
import colonnade.config.{ColonnadeConfig, ShellConfig}
import colonnade.formats.FrameRegisters

final class PhotoCompositorIO(config: ColonnadeConfig, shell: ShellConfig) extends Bundle {
  val settings = Input(new FramebufferSettings) // constant while rows are under way
  val rows     = Flipped(Decoupled(new TileRow(config, PixelWord.bits(config))))
  val out      = Decoupled(new TileRow(config))
  val axi      = new AxiReadPort(BurstWriter.idBits, shell.busBytes)

  /** Pulses: a row of the photo lies outside its window, and its pixels are dropped; a read has failed. */
  val isOutside = Output(Bool())
  val isError   = Output(Bool())
  val isIdle    = Output(Bool())
}

/** Puts the camera's photo, darkened by the shadow ratios, into the pixels of a row that do not show the object.
  *
  * A row with such pixels reads its part of the photo, one burst; up to [[PhotoCompositor.maxRows]] rows wait for
  * theirs. Rows leave in order, at the pace of the bus: as many pixels per cycle as a beat has, [[PhotoPixel.latency]]
  * cycles after their beat.
  */
final class PhotoCompositor(config: ColonnadeConfig, shell: ShellConfig) extends Module {
  import PhotoCompositor._

  val io = IO(new PhotoCompositorIO(config, shell))

  private val tileSize = config.frame.tileSize
  private val rowBytes = tileSize * photoBytes
  private val lanes    = tileSize.min(shell.busBytes / photoBytes)
  private val beats    = tileSize / lanes
  private val photo    = io.settings.photo

  // Where the photo of a row lies
  private val waits   = RegInit(false.B)
  private val row     = RegEnable(io.rows.bits, io.rows.fire)
  private val address = RegEnable(addressOf(io.rows.bits), io.rows.fire)
  private val shows   = VecInit(row.pixels.map(PixelWord.showsPhoto)).asUInt & row.mask
  private val isIn    = photo.window.contains(address, rowBytes.U)
  private val reads   = shows.orR && isIn

  private def addressOf(row: TileRow): UInt =
    (photo.base + row.y * photo.stride + (row.tile ## 0.U(log2Ceil(rowBytes).W)))(Axi.addressBits - 1, 0)

  // A row that reads waits for its data in a queue, in the order of the bursts
  private val pending = Module(new Queue(new PendingRow(config, shell), maxRows, useSyncReadMem = true))
  io.axi.ar.valid              := waits && reads && pending.io.enq.ready
  io.axi.ar.bits.id            := 0.U
  io.axi.ar.bits.addr          := address
  io.axi.ar.bits.len           := (beats - 1).U
  io.axi.ar.bits.size          := Axi.size(shell.busBytes)
  io.axi.ar.bits.burst         := Axi.incr
  pending.io.enq.valid         := waits && (!reads || io.axi.ar.ready)
  pending.io.enq.bits.row      := row
  pending.io.enq.bits.lane     := address(log2Ceil(shell.busBytes) - 1, 0) >> log2Ceil(lanes * photoBytes)
  pending.io.enq.bits.reads    := reads
  pending.io.enq.bits.row.mask := Mux(isIn, row.mask, row.mask & ~shows)
  io.isOutside                 := pending.io.enq.fire && shows.orR && !isIn
  io.rows.ready                := !waits || pending.io.enq.fire
  when(io.rows.ready) { waits := io.rows.valid }

  // A beat of the row and of the photo per cycle
  private val data    = Module(new Queue(UInt((8 * shell.busBytes).W), 2))
  private val head    = pending.io.deq.bits
  private val beat    = RegInit(0.U(log2Ceil(beats).max(1).W))
  private val isLast  = beat === (beats - 1).U
  private val moves   = Wire(Bool())
  private val isGiven = pending.io.deq.valid && (!head.reads || data.io.deq.valid)
  private val texels  = data.io.deq.bits.asTypeOf(Vec(shell.busBytes / photoBytes / lanes, Vec(lanes, UInt(32.W))))
  data.io.enq.valid    := io.axi.r.valid
  data.io.enq.bits     := io.axi.r.bits.data
  io.axi.r.ready       := data.io.enq.ready
  io.isError           := io.axi.r.fire && io.axi.r.bits.resp =/= 0.U
  data.io.deq.ready    := pending.io.deq.valid && head.reads && moves
  pending.io.deq.ready := isGiven && moves && isLast
  when(isGiven && moves) { beat := Mux(isLast, 0.U, beat + 1.U) }

  private val valids = Seq.iterate(isGiven, PhotoPixel.latency + 1)(valid => RegEnable(valid, false.B, moves))
  private val lasts  = ShiftRegister(isLast, PhotoPixel.latency, moves)
  private val places = ShiftRegister(Cat(head.row.tile, head.row.y, head.row.mask), PhotoPixel.latency, moves)
  private val words  = VecInit.tabulate(lanes) { lane =>
    val pixel = Module(new PhotoPixel(config))
    pixel.enable      := moves
    pixel.format      := io.settings.format
    pixel.hasStrength := photo.hasStrengths
    pixel.word        := pick(Seq.tabulate(beats)(index => head.row.pixels(index * lanes + lane)), beat)
    pixel.photo       := pick(texels.map(_(lane)), head.lane)
    pixel.out
  }

  private def pick(values: Seq[UInt], index: UInt): UInt =
    if (values.size == 1) values.head else VecInit(values)(index(log2Ceil(values.size) - 1, 0))

  // Beats become a row
  private val gathered = Reg(UInt((tileSize * words.head.getWidth).W))
  private val isOut    = RegInit(false.B)
  private val place    = Reg(chiselTypeOf(places))
  moves := !valids.last || !isOut || io.out.ready // a beat waits until the row before it has left
  when(io.out.fire) { isOut := false.B }
  when(valids.last && moves) {
    gathered := (words.asUInt ## gathered) >> words.getWidth
    isOut    := lasts
    place    := places
  }
  io.out.valid       := isOut
  io.out.bits.pixels := gathered.asTypeOf(io.out.bits.pixels)
  io.out.bits.mask   := place
  io.out.bits.y      := place >> tileSize
  io.out.bits.tile   := place >> (tileSize + io.out.bits.y.getWidth)
  io.isIdle          := !waits && !pending.io.deq.valid && !valids.drop(1).reduce(_ || _) && !isOut
}

/** A row that waits for its part of the photo. */
final class PendingRow(config: ColonnadeConfig, shell: ShellConfig) extends Bundle {
  val row   = new TileRow(config, PixelWord.bits(config))
  val reads = Bool()

  /** Of a beat wider than the row: the part with the row. */
  val lane = UInt(log2Ceil(shell.busBytes).W)
}

object PhotoCompositor {
  val photoBytes: Int = 4  // a pixel of the photo, XRGB8888
  val maxRows:    Int = 16 // rows that wait for their part of the photo
}

/** A pixel of the photo times its shadow ratio, in the framebuffer's format; docs/bus-shell.md. One per cycle.
  *
  * The photo's sRGB code becomes 16 linear bits, by a table. The strength of the shadow moves the ratio to 1.0. Their
  * product is rounded to 16 bits.
  */
final class PhotoPixel(config: ColonnadeConfig) extends Module {
  import PhotoPixel._

  val enable = IO(Input(Bool()))
  val format = IO(Input(UInt(PixelFormat.getWidth.W)))

  /** See [[PixelWord]]: a shadow ratio, or a pixel that passes as it is. */
  val word = IO(Input(UInt(PixelWord.bits(config).W)))

  val photo = IO(Input(UInt(32.W))) // XRGB8888

  /** The highest byte of the photo is the strength of the shadow; otherwise it is whole. */
  val hasStrength = IO(Input(Bool()))

  val out = IO(Output(UInt((8 * PixelFormat.maxBytes).W)))

  private val ratioBits = FrameRegisters.weight.format.width
  private val fraction  = FrameRegisters.weight.format.fraction
  private val table     = VecInit(
    (0 until 1 << SrgbEncoder.codeBits).map(code => SrgbEncoder.decoded(code, linearBits).U(linearBits.W))
  )
  private val strength = RegEnable(Mux(hasStrength, photo(31, 24), whole.U(8.W)), enable)
  private val channels = Seq.tabulate(3) { channel =>
    val code    = photo(8 * (2 - channel) + 7, 8 * (2 - channel))
    val linear  = RegEnable(table(ShiftRegister(code, 2, enable)), enable)
    val shadow  = RegEnable(word(ratioBits * (channel + 1) - 1, ratioBits * channel), enable)
    val sum     = RegEnable(weighted(strength, shadow), enable)
    val ratio   = RegEnable(quotient(sum)(ratioBits - 1, 0), enable)
    val product = RegEnable(linear * ratio, enable)
    val rounded = (product +& (1 << (fraction - 1)).U) >> fraction
    val result  =
      RegEnable(Mux((rounded >> linearBits).orR, ((1 << linearBits) - 1).U, rounded(linearBits - 1, 0)), enable)
    val encoder = Module(new SrgbEncoder(linearBits))
    encoder.linear := result
    encoder.enable := enable
    (encoder.code, ShiftRegister(result, SrgbEncoder.latency, enable))
  }

  /** `strength` of `ratio` and the rest of 1.0, times 255; with the half that rounds, and the one of [[quotient]]. */
  private def weighted(strength: UInt, ratio: UInt): UInt =
    strength * ratio +& (~strength ## 0.U(fraction.W)) +& (whole / 2 + 1).U

  private val passed = ShiftRegister(word, latency, enable)
  private val mixed  = PixelFormat.packed(format, channels.map(_._1), channels.map(_._2), isObject = false.B)
  out := Mux(PixelWord.showsPhoto(passed), mixed, passed)
}

object PhotoPixel {
  val linearBits: Int = 16                      // of a linear channel of the photo; all ones is 1.0
  val latency:    Int = 5 + SrgbEncoder.latency // cycles from a pixel to its word
  val whole:      Int = 255                     // strength of a whole shadow

  /** (`sum` - 1) over 255, rounded down; `sum` is 1 to 2^21^. (2^24^ - 1) / 255 is 2^16^ + 2^8^ + 1. */
  def quotient(sum: UInt): UInt = ((sum ## 0.U(16.W)) +& (sum ## 0.U(8.W)) +& sum) >> 24
}
