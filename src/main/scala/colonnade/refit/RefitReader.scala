package colonnade.refit

import chisel3._
import chisel3.util._
import colonnade.axi.{Axi, AxiReadPort}
import colonnade.common.TimingSlice

final class RefitReaderIO(busBytes: Int) extends Bundle {

  /** Lines to read, by their number: 0 of the plan, 1 of vertices. There is space for their data. */
  val lines = Vec(2, Flipped(Decoupled(UInt((Axi.addressBits - log2Ceil(RefitPlan.lineBytes)).W))))

  /** The data of each in order, 128 bits at a time. */
  val data    = Vec(2, Valid(UInt(RefitPlan.entryBits.W)))
  val axi     = new AxiReadPort(RefitReader.idBits, busBytes)
  val isError = Output(Bool()) // a pulse: a read has failed
}

/** Reads lines of 64 bytes, vertices first, and cuts beats to entries, or puts them together. */
final class RefitReader(busBytes: Int) extends Module {
  val io = IO(new RefitReaderIO(busBytes))

  private val entry = RefitPlan.entryBits / 8
  private val ar    = Wire(chiselTypeOf(io.axi.ar))
  private val id    = io.lines(1).valid
  ar.valid          := io.lines.map(_.valid).reduce(_ || _)
  ar.bits.id        := id
  ar.bits.addr      := Mux(id, io.lines(1).bits, io.lines(0).bits) ## 0.U(log2Ceil(RefitPlan.lineBytes).W)
  ar.bits.len       := (RefitPlan.lineBytes / busBytes - 1).U
  ar.bits.size      := Axi.size(busBytes)
  ar.bits.burst     := Axi.incr
  io.lines(0).ready := ar.ready && !id
  io.lines(1).ready := ar.ready
  io.axi.ar :<>= TimingSlice.queue(ar) // holds

  // A beat is cut to entries; narrow beats are put together, each stream apart: they may alternate
  private val beat   = TimingSlice.queue(io.axi.r)
  private val last   = (busBytes / entry).max(1) - 1
  private val part   = RegInit(0.U(log2Ceil(last + 1).max(1).W))
  private val pieces = entry / busBytes.min(entry)
  beat.ready := part === last.U
  when(beat.valid) { part := Mux(beat.ready, 0.U, part + 1.U) }
  for ((data, index) <- io.data.zipWithIndex) {
    val isHere = beat.valid && beat.bits.id === index.U
    if (pieces == 1) {
      data.valid := isHere
      data.bits  := (if (last == 0) beat.bits.data
                    else beat.bits.data.asTypeOf(Vec(last + 1, chiselTypeOf(data.bits)))(part))
    } else {
      val before = Reg(UInt((8 * (entry - busBytes)).W))
      val count  = RegInit(0.U(log2Ceil(pieces).W))
      data.valid := isHere && count.andR
      data.bits  := beat.bits.data ## before
      when(isHere) {
        count  := count + 1.U
        before := (beat.bits.data ## before) >> (8 * busBytes)
      }
    }
  }
  io.isError := io.axi.r.fire && io.axi.r.bits.resp =/= 0.U
}

object RefitReader {
  val idBits: Int = 1
}
