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

  /** Bursts that are under way at a write port whose memory answers when `answers`, and each burst once. Address and
    * data of a burst are accepted in any order.
    *
    * @return the bursts whose address has been accepted and that are not answered, and the address of the current beat
    */
  def writes(port: AxiWritePort, answers: Bool): (UInt, UInt) = {
    holds(port.aw, "aw")
    holds(port.w, "w")

    // Addresses that have been offered and whose data are not complete, in order
    val pending   = Module(new Queue(chiselTypeOf(port.aw.bits), 16))
    val announced = RegNext(port.aw.valid && !port.aw.ready, false.B)
    val addresses = port.aw.valid && !announced
    pending.io.enq.valid := addresses
    pending.io.enq.bits  := port.aw.bits
    val beat   = RegInit(0.U(8.W))
    val isLast = beat === pending.io.deq.bits.len
    pending.io.deq.ready := port.w.fire && isLast
    when(port.w.fire) { beat := Mux(isLast, 0.U, beat + 1.U) }
    assert(!addresses || pending.io.enq.ready, "at most 16 bursts")
    assert(!port.w.valid || pending.io.deq.valid, "an address is offered before its data")
    assert(!port.w.valid || port.w.bits.last === isLast, "the last beat ends the burst")

    val complete = RegInit(0.U(5.W))
    val bursts   = RegInit(0.U(5.W))
    port.b.valid     := answers && complete =/= 0.U && bursts =/= 0.U
    port.b.bits.id   := 0.U
    port.b.bits.resp := 0.U
    complete         := complete + pending.io.deq.fire - port.b.fire
    bursts           := bursts + port.aw.fire - port.b.fire
    (bursts, pending.io.deq.bits.addr + beat * (1 << log2Ceil(port.w.bits.strb.getWidth)).U)
  }
}
