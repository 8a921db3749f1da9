package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.axi.{Axi, AxiReadPort}
import colonnade.common.TimingSlice
import colonnade.config.ShellConfig

final class ImageReaderIO(shell: ShellConfig) extends Bundle {

  /** A pulse: reads `bytes` from `base`, both multiples of [[ImageReader.burstBytes]], while idle. */
  val start = Input(Bool())
  val base  = Input(UInt(Axi.addressBits.W))
  val bytes = Input(UInt(32.W))

  /** Starts no more reads, and discards their data, until the next start. */
  val stop  = Input(Bool())
  val words = Decoupled(UInt(32.W))
  val axi   = new AxiReadPort(BurstWriter.idBits, shell.busBytes)

  /** All words have been taken or discarded; a pulse: a read has failed. */
  val isIdle  = Output(Bool())
  val isError = Output(Bool())
}

/** Reads a range of memory as a stream of 32-bit words, in bursts of 128 bytes.
  *
  * Up to four bursts are under way; each has a place in a queue before it is requested, so R never waits. One word per
  * cycle.
  */
final class ImageReader(shell: ShellConfig) extends Module {
  import ImageReader._

  val io = IO(new ImageReaderIO(shell))

  private val bus   = shell.busBytes
  private val beats = burstBytes / bus
  private val left  = RegInit(0.U((32 - log2Ceil(burstBytes)).W)) // bursts to request
  private val next  = Reg(UInt((Axi.addressBits - log2Ceil(burstBytes)).W))
  private val used  = RegInit(0.U(log2Ceil(maxBursts + 1).W))     // places in the queue

  io.axi.ar.valid      := left =/= 0.U && used =/= maxBursts.U
  io.axi.ar.bits.id    := 0.U
  io.axi.ar.bits.addr  := next ## 0.U(log2Ceil(burstBytes).W)
  io.axi.ar.bits.len   := (beats - 1).U
  io.axi.ar.bits.size  := Axi.size(bus)
  io.axi.ar.bits.burst := Axi.incr
  when(io.axi.ar.fire) {
    next := next + 1.U
    left := left - 1.U
  }
  when(io.start) {
    next := io.base >> log2Ceil(burstBytes)
    left := io.bytes >> log2Ceil(burstBytes)
  }.elsewhen(io.stop && (!io.axi.ar.valid || io.axi.ar.ready)) {
    left := 0.U // an address that is offered holds until it is accepted
  }

  // Beats to words; while it stops, a beat is discarded as a whole
  private val queue   = Module(new Queue(UInt((8 * bus).W), maxBursts * beats, useSyncReadMem = true))
  private val queued  = TimingSlice.queue(queue.io.deq)          // of the memory's output
  private val ofBeat  = bus / 4
  private val word    = RegInit(0.U(log2Ceil(burstBytes / 4).W))
  private val lane    = if (ofBeat == 1) 0.U else word(log2Ceil(ofBeat) - 1, 0)
  private val last    = word | Mux(io.stop, (ofBeat - 1).U, 0.U) // the word of this cycle, or of its beat
  private val isTaken = queued.valid && (io.words.ready || io.stop)
  queue.io.enq.valid := io.axi.r.valid
  queue.io.enq.bits  := io.axi.r.bits.data
  queued.ready       := isTaken && (io.stop || lane === (ofBeat - 1).U)
  io.axi.r.ready     := queue.io.enq.ready
  io.words.valid     := queued.valid && !io.stop
  io.words.bits      := queued.bits.asTypeOf(Vec(ofBeat, UInt(32.W)))(lane)
  when(isTaken) { word := last + 1.U }
  used := used + io.axi.ar.fire - (isTaken && last.andR)

  io.isIdle  := left === 0.U && used === 0.U
  io.isError := io.axi.r.fire && io.axi.r.bits.resp =/= 0.U
}

object ImageReader {
  val burstBytes: Int = 128
  val maxBursts:  Int = 4
}
