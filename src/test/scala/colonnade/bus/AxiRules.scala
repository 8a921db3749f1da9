package colonnade.bus

import chisel3._
import chisel3.util.{log2Ceil, DecoupledIO, Queue}
import colonnade.axi.AxiWritePort

/** Assertions of AXI4 on the ports of a master, for proofs. */
object AxiRules {

  /** What is offered stays until it is accepted. */
  def holds(channel: DecoupledIO[Data], name: String): Unit = {
    val waited = RegNext(channel.valid && !channel.ready, false.B)
    val bits   = RegNext(channel.bits.asUInt)
    assert(!waited || channel.valid, s"$name stays valid")
    assert(!waited || channel.bits.asUInt === bits, s"$name does not change")
  }

  /** Bursts that are under way at a write port whose memory answers when `answers`, and each burst once.
    *
    * @return the bursts whose address has been accepted and that are not answered, and the address of the current beat
    */
  def writes(port: AxiWritePort, answers: Bool): (UInt, UInt) = {
    holds(port.aw, "aw")
    holds(port.w, "w")

    // Lengths of the bursts whose data are not complete, in order; addresses with them
    val pending = Module(new Queue(chiselTypeOf(port.aw.bits), 16))
    pending.io.enq.valid := port.aw.fire
    pending.io.enq.bits  := port.aw.bits
    val beat   = RegInit(0.U(8.W))
    val isLast = beat === pending.io.deq.bits.len
    pending.io.deq.ready := port.w.fire && isLast
    when(port.w.fire) { beat := Mux(isLast, 0.U, beat + 1.U) }
    assert(!port.aw.fire || pending.io.enq.ready, "at most 16 bursts")
    assert(!port.w.valid || pending.io.deq.valid, "data follow their address")
    assert(!port.w.valid || port.w.bits.last === isLast, "the last beat ends the burst")

    val complete = RegInit(0.U(5.W))
    val bursts   = RegInit(0.U(5.W))
    port.b.valid     := answers && complete =/= 0.U
    port.b.bits.id   := 0.U
    port.b.bits.resp := 0.U
    complete         := complete + pending.io.deq.fire - port.b.fire
    bursts           := bursts + port.aw.fire - port.b.fire
    (bursts, pending.io.deq.bits.addr + beat * (1 << log2Ceil(port.w.bits.strb.getWidth)).U)
  }
}
