package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.axi.AxiReadPort

final class AxiReadGuardIO(idBits: Int, busBytes: Int) extends Bundle {
  val inner = Flipped(new AxiReadPort(idBits, busBytes))
  val axi   = new AxiReadPort(idBits, busBytes)

  /** Takes nothing more from the master, and discards the data of its bursts. */
  val abandon = Input(Bool())
  val isIdle  = Output(Bool()) // no burst is under way
}

/** Ends the read bursts of a master that is reset: their data are taken and discarded. See [[AxiWriteGuard]].
  *
  * @param maxBursts bursts under way at a time
  */
final class AxiReadGuard(idBits: Int, busBytes: Int, maxBursts: Int) extends Module {
  val io = IO(new AxiReadGuardIO(idBits, busBytes))

  private val bursts   = RegInit(0.U(log2Ceil(maxBursts + 1).W))
  private val ar       = Module(new Queue(io.axi.ar.bits.cloneType, 2))
  private val canStart = bursts =/= maxBursts.U && !io.abandon
  ar.io.enq.valid   := io.inner.ar.valid && canStart
  ar.io.enq.bits    := io.inner.ar.bits
  io.inner.ar.ready := ar.io.enq.ready && canStart
  io.axi.ar :<>= ar.io.deq

  io.inner.r.valid := io.axi.r.valid && !io.abandon
  io.inner.r.bits  := io.axi.r.bits
  io.axi.r.ready   := io.inner.r.ready || io.abandon
  private val ends = io.axi.r.fire && io.axi.r.bits.last && bursts =/= 0.U
  bursts    := bursts + ar.io.enq.fire - ends
  io.isIdle := bursts === 0.U
}
