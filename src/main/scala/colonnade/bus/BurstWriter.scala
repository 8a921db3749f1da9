package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.axi.{Axi, AxiWritePort}
import colonnade.common.TimingSlice
import colonnade.config.{ColonnadeConfig, ShellConfig}

final class BurstWriterIO(config: ColonnadeConfig, shell: ShellConfig) extends Bundle {
  val settings = Input(new FramebufferSettings) // constant while rows are written
  val rows     = Flipped(Decoupled(new TileRow(config)))
  val axi      = new AxiWritePort(BurstWriter.idBits, shell.busBytes)
  val drop     = Input(Bool())                  // rows are dropped: a write has failed

  /** A pulse: a row lies outside the window, and is dropped. */
  val isOutside = Output(Bool())
  val isIdle    = Output(Bool())
}

/** Writes rows of a tile, each as one burst.
  *
  * Rows of narrow pixels may be narrower than the bus: they are one beat with the lanes of the row. Rows begin at
  * multiples of their size, a power of two of at most 256 bytes, so no burst crosses 4 KB. A burst's beats follow each
  * other; the address of the next one goes out during the last beat. A row takes two cycles at least: in the first one
  * its address is compared with the window.
  */
final class BurstWriter(config: ColonnadeConfig, shell: ShellConfig) extends Module {
  val io = IO(new BurstWriterIO(config, shell))

  private val tileSize = config.frame.tileSize
  private val bus      = shell.busBytes
  private val bytesLog = PixelFormat.bytesLog(io.settings.format)
  private val rowBytes = tileSize.U << bytesLog

  // Where the row lies
  private val hasRow      = RegInit(false.B)
  private val row         = RegEnable(io.rows.bits, io.rows.fire)
  private val address     = RegEnable(addressOf(io.rows.bits), io.rows.fire)
  private val rowBeats    = RowBeats(config, shell, io.settings.format, row, address)
  private val isInside    = TimingSlice(io.settings.window.contains(address, rowBytes))
  private val isOffered   = RegInit(false.B) // the address is on the bus, and holds
  private val isChecked   = RegInit(false.B)
  private val mayLeave    = hasRow && isChecked
  private val isDropped   = mayLeave && !isOffered && (io.drop || !isInside)
  private val isAddressed = io.axi.aw.fire
  private val leaves      = isDropped || isAddressed
  io.rows.ready := !hasRow || leaves
  when(io.rows.ready) { hasRow := io.rows.valid }
  isChecked    := hasRow && !leaves
  io.isOutside := isDropped && !io.drop

  private def addressOf(row: TileRow): UInt =
    (io.settings.base + row.y * io.settings.stride +
      ((row.tile ## 0.U(log2Ceil(tileSize).W)) << bytesLog))(Axi.addressBits - 1, 0)

  // Beats of the row before
  private val beats  = RegInit(0.U(log2Ceil(BurstWriter.maxBeats(config, shell) + 1).W))
  private val isLast = beats === 1.U
  private val data   = Reg(UInt((8 * (tileSize * PixelFormat.maxBytes).max(bus)).W))
  private val strobe = Reg(UInt((tileSize * PixelFormat.maxBytes).max(bus).W))
  io.axi.w.valid     := beats =/= 0.U
  io.axi.w.bits.data := data
  io.axi.w.bits.strb := strobe
  io.axi.w.bits.last := isLast
  when(io.axi.w.fire) {
    beats  := beats - 1.U
    data   := data >> (8 * bus)
    strobe := strobe >> bus
  }

  // The row's address goes out when its beats may follow
  io.axi.aw.valid      := isOffered || (mayLeave && !isDropped && (beats === 0.U || (isLast && io.axi.w.ready)))
  isOffered            := io.axi.aw.valid && !io.axi.aw.ready
  io.axi.aw.bits.id    := 0.U
  io.axi.aw.bits.addr  := address
  io.axi.aw.bits.len   := rowBeats.len
  io.axi.aw.bits.size  := Axi.size(bus)
  io.axi.aw.bits.burst := Axi.incr
  when(isAddressed) {
    beats  := rowBeats.count
    data   := rowBeats.data
    strobe := rowBeats.strobe
  }

  io.axi.b.ready := true.B
  io.isIdle      := !hasRow && beats === 0.U
}

object BurstWriter {
  val idBits: Int = 1

  def maxBeats(config: ColonnadeConfig, shell: ShellConfig): Int =
    (config.frame.tileSize * PixelFormat.maxBytes / shell.busBytes).max(1)
}
