package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.config.{ColonnadeConfig, ShellConfig}

/** A beat of the pixel stream. */
final class PixelBeat(busBytes: Int) extends Bundle {

  /** Line and column of the first pixel of the packet: y in bits 31 to 16, x in bits 15 to 0. */
  val user = UInt(32.W)

  /** The last beat of a packet, which is a row of a tile; the bytes that are there. */
  val last = Bool()
  val keep = UInt(busBytes.W)
  val data = UInt((8 * busBytes).W)
}

/** Sends rows of a tile to a stream, each as one packet of [[RowBeats]], one beat per cycle. A packet follows the one
  * before without a gap.
  */
final class RowStreamer(config: ColonnadeConfig, shell: ShellConfig) extends Module {
  val format = IO(Input(UInt(PixelFormat.getWidth.W)))
  val rows   = IO(Flipped(Decoupled(new TileRow(config))))
  val out    = IO(Decoupled(new PixelBeat(shell.busBytes)))
  val isIdle = IO(Output(Bool()))

  private val bus   = shell.busBytes
  private val beats = RegInit(0.U(log2Ceil(BurstWriter.maxBeats(config, shell) + 1).W))
  private val row   = RowBeats(config, shell, format, rows.bits, 0.U(32.W))
  private val width = (config.frame.tileSize * PixelFormat.maxBytes).max(bus)
  private val data  = Reg(UInt((8 * width).W))
  private val keep  = Reg(UInt(width.W))
  private val user  = RegEnable(
    rows.bits.y.pad(16) ## (rows.bits.tile ## 0.U(log2Ceil(config.frame.tileSize).W)).pad(16),
    rows.fire
  )

  rows.ready := beats === 0.U || (beats === 1.U && out.ready)
  when(out.fire) {
    beats := beats - 1.U
    data  := data >> (8 * bus)
    keep  := keep >> bus
  }
  when(rows.fire) {
    beats := row.count
    data  := row.data
    keep  := row.strobe
  }
  out.valid     := beats =/= 0.U
  out.bits.data := data
  out.bits.keep := keep
  out.bits.last := beats === 1.U
  out.bits.user := user
  isIdle        := beats === 0.U
}

/** Ends the packet of a source that is reset: its last beat has no bytes. See [[AxiWriteGuard]]. */
final class StreamGuard(busBytes: Int) extends Module {
  val inner = IO(Flipped(Decoupled(new PixelBeat(busBytes))))
  val out   = IO(Decoupled(new PixelBeat(busBytes)))

  /** Takes nothing more from the source, and ends its packet. */
  val abandon = IO(Input(Bool()))
  val isIdle  = IO(Output(Bool()))

  private val queue  = Module(new Queue(new PixelBeat(busBytes), 2))
  private val isOpen = RegInit(false.B) // beats of a packet have entered, its last one has not
  private val user   = RegEnable(inner.bits.user, inner.fire)
  queue.io.enq.valid := Mux(abandon, isOpen, inner.valid)
  queue.io.enq.bits  := inner.bits
  when(abandon) {
    queue.io.enq.bits.last := true.B
    queue.io.enq.bits.keep := 0.U
    queue.io.enq.bits.user := user
  }
  when(queue.io.enq.fire) { isOpen := !queue.io.enq.bits.last }
  inner.ready := queue.io.enq.ready && !abandon
  out :<>= queue.io.deq
  isIdle := !isOpen && !queue.io.deq.valid
}
