package colonnade.query

import chisel3._
import chisel3.util.{log2Ceil, Mux1H, OHToUInt}
import colonnade.axi.{AxiAddress, AxiReadPort, AxiWritePort}
import colonnade.common.{Merger, RoundRobin}
import colonnade.formats.RayBatch

final class RayPortIO(count: Int) extends Bundle {
  val reads  = Vec(count, Flipped(new AxiReadPort(1, RayBatch.bytes)))
  val writes = Vec(count, Flipped(new AxiWritePort(1, RayBatch.bytes)))
  val read   = new AxiReadPort(RayPort.idBits(count), RayBatch.bytes)
  val write  = new AxiWritePort(RayPort.idBits(count), RayBatch.bytes)
}

/** One port for some masters, by round-robin; a master's number is its id, so responses of different ones may overtake each
  * other. The beats of a write follow its address before the next address is taken.
  */
final class RayPort(count: Int) extends Module {
  val io = IO(new RayPortIO(count))

  private val ids = RayPort.idBits(count)

  // Reads
  private val addresses = Module(new Merger(new AxiAddress(ids), count)).io
  for (((to, from), index) <- addresses.givers.zip(io.reads).zipWithIndex) {
    to :<>= from.ar
    to.bits.id := index.U
  }
  io.read.ar :<>= addresses.items
  for ((port, index) <- io.reads.zipWithIndex) {
    port.r.valid := io.read.r.valid && io.read.r.bits.id === index.U
    port.r.bits  := io.read.r.bits
  }
  io.read.r.ready := io.reads(io.read.r.bits.id).r.ready

  // Writes: the master whose beats are awaited
  private val arbiter = Module(new RoundRobin(count)).io
  private val sends   = RegInit(false.B)
  private val sender  = Reg(UInt(ids.W))
  private val grant   = arbiter.grant
  arbiter.requests    := Mux(sends, 0.U, VecInit(io.writes.map(_.aw.valid)).asUInt)
  arbiter.isTaken     := io.write.aw.fire
  io.write.aw.valid   := arbiter.requests.orR
  io.write.aw.bits    := Mux1H(grant, io.writes.map(_.aw.bits))
  io.write.aw.bits.id := OHToUInt(grant)
  io.write.w.valid    := sends && io.writes(sender).w.valid
  io.write.w.bits     := io.writes(sender).w.bits
  io.write.b.ready    := io.writes(io.write.b.bits.id).b.ready
  for ((port, index) <- io.writes.zipWithIndex) {
    port.aw.ready := grant(index) && io.write.aw.ready
    port.w.ready  := sends && sender === index.U && io.write.w.ready
    port.b.valid  := io.write.b.valid && io.write.b.bits.id === index.U
    port.b.bits   := io.write.b.bits
  }
  when(io.write.w.fire && io.write.w.bits.last) { sends := false.B }
  when(io.write.aw.fire) {
    sends  := true.B
    sender := OHToUInt(grant)
  }
}

object RayPort {
  def idBits(count: Int): Int = log2Ceil(count.max(2))
}
