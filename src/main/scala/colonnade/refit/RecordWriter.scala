package colonnade.refit

import chisel3._
import chisel3.util._
import colonnade.axi.{Axi, AxiWritePort}
import colonnade.config.ColonnadeConfig

final class RecordWriterIO(config: ColonnadeConfig, busBytes: Int) extends Bundle {
  val base    = Input(UInt(Axi.addressBits.W))                      // of the record 0
  val count   = Input(UInt(RefitPlan.countBits.W))
  val records = Vec(2, Flipped(Decoupled(new RefitRecord(config)))) // the first goes before the others
  val axi     = new AxiWritePort(RefitReader.idBits, busBytes)
  val isIdle  = Output(Bool())                                      // all are written, and answered
  val isError = Output(Bool())                                      // a pulse: a write has failed

  /** A pulse: a record is not there, and dropped. */
  val isOutside = Output(Bool())
}

/** Writes records, each as one burst. */
final class RecordWriter(config: ColonnadeConfig, busBytes: Int) extends Module {
  val io = IO(new RecordWriterIO(config, busBytes))

  private val bytes   = RecordWriter.recordBytes
  private val arbiter = Module(new Arbiter(new RefitRecord(config), io.records.size))
  arbiter.io.in.zip(io.records).foreach { case (in, record) => in :<>= record }

  // Its address, then its beats
  private val hasRecord = RegInit(false.B)
  private val record    = Reg(new RefitRecord(config))
  private val address   = Reg(UInt(Axi.addressBits.W))
  private val isInside  = Reg(Bool())
  private val data      = Module(new Queue(new RefitRecord(config), RecordWriter.depth, useSyncReadMem = true))
  private val aw        = io.axi.aw
  private val leaves    = hasRecord && (!isInside || (aw.ready && data.io.enq.ready))
  arbiter.io.out.ready := !hasRecord || leaves
  when(arbiter.io.out.ready) {
    hasRecord := arbiter.io.out.valid
    record    := arbiter.io.out.bits
    address   := io.base + (arbiter.io.out.bits.address ## 0.U(log2Ceil(bytes).W))
    isInside  := arbiter.io.out.bits.address < io.count
  }
  io.isOutside             := hasRecord && !isInside
  aw.valid                 := hasRecord && isInside && data.io.enq.ready
  aw.bits.id               := 0.U
  aw.bits.addr             := address
  aw.bits.len              := ((bytes / busBytes).max(1) - 1).U
  aw.bits.size             := Axi.size(busBytes)
  aw.bits.burst            := Axi.incr
  data.io.enq.valid        := hasRecord && isInside && aw.ready
  data.io.enq.bits         := record
  data.io.enq.bits.address := address >> log2Ceil(bytes) // of which the low bits choose lanes

  private val beats  = (bytes / busBytes).max(1)
  private val beat   = RegInit(0.U(log2Ceil(beats).max(1).W))
  private val isLast = beat === (beats - 1).U
  private val w      = io.axi.w
  w.valid           := data.io.deq.valid
  w.bits.last       := isLast
  data.io.deq.ready := w.ready && isLast
  when(w.fire) { beat := Mux(isLast, 0.U, beat + 1.U) }
  if (busBytes <= bytes) {
    w.bits.data := (data.io.deq.bits.record >> (beat << log2Ceil(8 * busBytes)))(8 * busBytes - 1, 0)
    w.bits.strb := Fill(busBytes, 1.U)
  } else {
    val lanes = busBytes / bytes
    w.bits.data := Fill(lanes, data.io.deq.bits.record)
    w.bits.strb := FillInterleaved(bytes, UIntToOH(data.io.deq.bits.address(log2Ceil(lanes) - 1, 0), lanes))
  }

  private val unanswered = RegInit(0.U(16.W))
  unanswered     := unanswered + aw.fire - io.axi.b.fire
  io.axi.b.ready := true.B
  io.isError     := io.axi.b.fire && io.axi.b.bits.resp =/= 0.U
  io.isIdle      := !hasRecord && unanswered === 0.U
}

object RecordWriter {
  val recordBytes: Int = 32
  val depth:       Int = 8
}
