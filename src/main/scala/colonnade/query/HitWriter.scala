package colonnade.query

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled, FillInterleaved, Queue, UIntToOH}
import colonnade.axi.{Axi, AxiWritePort}
import colonnade.formats.RayBatch

/** Words of 8 bytes of a run: one, or two of a hit. */
final class HitWords extends Bundle {
  val words  = UInt(128.W)
  val isLast = Bool() // of consecutive ones
  val isEnd  = Bool() // of the run
}

final class HitWriterIO extends Bundle {
  val address = Input(UInt(Axi.addressBits.W)) // of consecutive hits
  val isWide  = Input(Bool())                  // words come in twos
  val hits    = Flipped(Decoupled(new HitWords))
  val axi     = new AxiWritePort(1, RayBatch.bytes)

  /** Pulses: a run's hits are in memory; or their write has failed. */
  val written = Output(Bool())
  val failed  = Output(Bool())
  val isIdle  = Output(Bool())
}

/** Writes the hits of runs, in order, by bursts of whole beats; the first and last beat of consecutive hits may be
  * partial. The beats of a burst are complete before its address goes out, so that the port never waits for them.
  */
final class HitWriter extends Module {
  val io = IO(new HitWriterIO)

  // Pack words into a beat
  private val beat     = Reg(Vec(8, UInt(64.W)))
  private val isFilled = RegInit(0.U(8.W))
  private val position = RegInit(0.U(3.W))                                // of consecutive ones
  private val at       = position + io.address(5, 3)
  private val lanes    = Mux(io.isWide, UIntToOH(at) | UIntToOH(at | 1.U), UIntToOH(at))(7, 0)
  private val isFull   = lanes(7)
  private val beats    = Module(new Queue(new PackedBeat, HitWriter.runBeats, useSyncReadMem = true)).io
  private val isPushed = RegInit(false.B)                                 // the beat is complete
  private val isLast   = Reg(Bool())
  private val isEnd    = Reg(Bool())
  private val ends     = Module(new Queue(new PackedRun, 2)).io
  private val count    = RegInit(0.U(log2Ceil(HitWriter.runBeats + 1).W)) // of their beats
  private val first    = Reg(UInt(Axi.addressBits.W))
  private val leaves   = isPushed && beats.enq.ready && (!isLast || ends.enq.ready)
  io.hits.ready := !isPushed || leaves
  when(leaves) {
    isFilled := 0.U
    isPushed := false.B
    count    := Mux(isLast, 0.U, count + 1.U)
  }
  when(io.hits.fire) {
    for (word <- 0 until 8) when(lanes(word)) {
      beat(word) := Mux(io.isWide && (word % 2 == 1).B, io.hits.bits.words(127, 64), io.hits.bits.words(63, 0))
    }
    isFilled := Mux(leaves, 0.U, isFilled) | lanes
    position := Mux(io.hits.bits.isLast, 0.U, position + Mux(io.isWide, 2.U, 1.U))
    isPushed := isFull || io.hits.bits.isLast
    isLast   := io.hits.bits.isLast
    isEnd    := io.hits.bits.isEnd
    first    := io.address
  }
  beats.enq.valid         := leaves
  beats.enq.bits.data     := beat.asUInt
  beats.enq.bits.isFilled := isFilled
  ends.enq.valid          := leaves && isLast
  ends.enq.bits.address   := Cat(first >> 6, 0.U(6.W))
  ends.enq.bits.beats     := count + 1.U
  ends.enq.bits.isEnd     := isEnd

  // Write them
  private val address = Reg(UInt(Axi.addressBits.W))
  private val left    = RegInit(0.U(log2Ceil(HitWriter.runBeats + 1).W)) // without an address
  private val sending = RegInit(0.U(log2Ceil(Run.burstBeats + 1).W))
  private val bursts  = Module(new Queue(Bool(), 8)).io                  // awaited: the last one of its run
  private val endsRun = Reg(Bool())
  private val burst   = Run.beatsAt(address, left)
  private val aw      = io.axi.aw
  private val w       = io.axi.w
  ends.deq.ready   := left === 0.U
  aw.valid         := left =/= 0.U && sending === 0.U && bursts.enq.ready
  aw.bits.id       := 0.U
  aw.bits.addr     := address
  aw.bits.len      := burst - 1.U
  aw.bits.size     := Axi.size(RayBatch.bytes)
  aw.bits.burst    := Axi.incr
  bursts.enq.valid := aw.fire
  bursts.enq.bits  := burst === left && endsRun
  when(ends.deq.fire) {
    address := ends.deq.bits.address
    left    := ends.deq.bits.beats
    endsRun := ends.deq.bits.isEnd
  }
  when(aw.fire) {
    address := address + (burst << log2Ceil(RayBatch.bytes))
    left    := left - burst
    sending := burst
  }
  w.valid         := sending =/= 0.U && beats.deq.valid
  w.bits.data     := beats.deq.bits.data
  w.bits.strb     := FillInterleaved(8, beats.deq.bits.isFilled)
  w.bits.last     := sending === 1.U
  beats.deq.ready := sending =/= 0.U && w.ready
  when(w.fire) { sending := sending - 1.U }

  // Responses, in order
  private val hasFailed  = RegInit(false.B)
  private val isError    = io.axi.b.bits.resp =/= Axi.okay
  private val isResponse = io.axi.b.fire && bursts.deq.bits
  io.axi.b.ready   := true.B
  bursts.deq.ready := io.axi.b.valid
  when(io.axi.b.fire) { hasFailed := !bursts.deq.bits && (hasFailed || isError) }
  io.written := isResponse && !hasFailed && !isError
  io.failed  := isResponse && (hasFailed || isError)
  io.isIdle  := !isPushed && position === 0.U && !ends.deq.valid && left === 0.U && !bursts.deq.valid
}

private object HitWriter {

  /** Beats of a run of hits, which begins with a beat. */
  val runBeats: Int = Run.rays * 16 / RayBatch.bytes
}

final private class PackedBeat extends Bundle {
  val data     = UInt(Run.beatBits.W)
  val isFilled = UInt(8.W) // by word of 8 bytes
}

final private class PackedRun extends Bundle {
  val address = UInt(Axi.addressBits.W)
  val beats   = UInt(log2Ceil(HitWriter.runBeats + 1).W)
  val isEnd   = Bool()
}
