package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.axi.AxiWritePort

final class AxiWriteGuardIO(idBits: Int, busBytes: Int) extends Bundle {

  /** Of the inner master, which may be reset at any time while `abandon` is set. It sends the address of a burst before
    * its data.
    */
  val inner = Flipped(new AxiWritePort(idBits, busBytes))
  val axi   = new AxiWritePort(idBits, busBytes)

  /** Takes nothing more from the master, and ends its bursts. */
  val abandon = Input(Bool())
  val isIdle  = Output(Bool()) // no burst is under way
}

/** Ends the write bursts of a master that is reset: their remaining beats write no bytes, and their answers are taken.
  *
  * It outlives the reset of the master, so the bus always sees whole bursts, and valid signals that hold. A beat passes in
  * one cycle. Data are offered from the second cycle after their address on, whether it has been accepted or not. At most
  * `maxBursts` bursts wait for their answers.
  */
final class AxiWriteGuard(idBits: Int, busBytes: Int, maxBursts: Int = AxiWriteGuard.maxBursts) extends Module {
  val io = IO(new AxiWriteGuardIO(idBits, busBytes))

  private val bursts = RegInit(0.U(log2Ceil(maxBursts + 1).W)) // without their answer
  private val aw     = Module(new Queue(io.axi.aw.bits.cloneType, 2))
  private val w      = Module(new Queue(io.axi.w.bits.cloneType, 2))

  // Beats that are owed for each address that has been offered, in order. They do not wait until it is accepted: a memory
  // may wait for them first (AXI4, A3.3.1).
  private val owed        = Module(new Queue(UInt(8.W), maxBursts))
  private val beats       = RegInit(0.U(8.W))
  private val isAnnounced = RegNext(io.axi.aw.valid && !io.axi.aw.ready, false.B)

  private val canStart = bursts =/= maxBursts.U && !io.abandon
  aw.io.enq.valid   := io.inner.aw.valid && canStart
  aw.io.enq.bits    := io.inner.aw.bits
  io.inner.aw.ready := aw.io.enq.ready && canStart
  owed.io.enq.valid := io.axi.aw.valid && !isAnnounced // never more than `maxBursts`
  owed.io.enq.bits  := io.axi.aw.bits.len

  private val isLast = beats === owed.io.deq.bits
  w.io.enq.valid     := owed.io.deq.valid && (io.inner.w.valid || io.abandon)
  w.io.enq.bits      := io.inner.w.bits
  w.io.enq.bits.last := isLast
  when(io.abandon) { w.io.enq.bits.strb := 0.U }
  io.inner.w.ready  := owed.io.deq.valid && w.io.enq.ready && !io.abandon
  owed.io.deq.ready := w.io.enq.fire && isLast
  when(w.io.enq.fire) { beats := Mux(isLast, 0.U, beats + 1.U) }

  io.axi.aw :<>= aw.io.deq
  io.axi.w :<>= w.io.deq

  io.axi.b.ready   := true.B
  io.inner.b.valid := io.axi.b.valid && !io.abandon
  io.inner.b.bits  := io.axi.b.bits
  bursts           := bursts + aw.io.enq.fire - (io.axi.b.fire && bursts =/= 0.U)
  io.isIdle        := bursts === 0.U
}

object AxiWriteGuard {
  val maxBursts: Int = 16
}
