package colonnade.bus

import chisel3._
import chisel3.util.log2Ceil
import colonnade.axi.{Axi, AxiAddress, AxiReadPort, AxiWritePort}

final class AxiWindowIO(idBits: Int, busBytes: Int) extends Bundle {

  /** Multiples of a beat; constant while bursts are under way. */
  val window = Input(new AddressWindow)

  /** Of a master that sends the address of a write before its beats, and no other address before its last beat. */
  val innerRead  = Flipped(new AxiReadPort(idBits, busBytes))
  val innerWrite = Flipped(new AxiWritePort(idBits, busBytes))
  val read       = new AxiReadPort(idBits, busBytes)
  val write      = new AxiWritePort(idBits, busBytes)

  /** No burst is under way beyond this module. */
  val readIsIdle  = Input(Bool())
  val writeIsIdle = Input(Bool())
}

/** Keeps a master's bursts in a window: one that leaves it does not reach the bus, and is answered by an error, when the
  * bursts before it have ended. Its beats are discarded, or have no value.
  */
final class AxiWindow(idBits: Int, busBytes: Int) extends Module {
  val io = IO(new AxiWindowIO(idBits, busBytes))

  private val beatLog = log2Ceil(busBytes)

  private def isInside(burst: AxiAddress): Bool = {
    val first = burst.addr >> beatLog
    first >= (io.window.base >> beatLog) && (first +& burst.len) < (io.window.end >> beatLog)
  }

  // Reads
  private val answersRead = RegInit(false.B)
  private val address     = Reg(new AxiAddress(idBits)) // of the refused burst, with the beats that are left
  private val mayRead     = isInside(io.innerRead.ar.bits)
  io.read.ar.valid      := io.innerRead.ar.valid && mayRead && !answersRead
  io.read.ar.bits       := io.innerRead.ar.bits
  io.innerRead.ar.ready := !answersRead && Mux(mayRead, io.read.ar.ready, io.readIsIdle)
  io.innerRead.r.valid  := answersRead || io.read.r.valid
  io.innerRead.r.bits   := io.read.r.bits
  io.read.r.ready       := io.innerRead.r.ready && !answersRead
  when(answersRead) {
    io.innerRead.r.bits.id   := address.id
    io.innerRead.r.bits.resp := Axi.slaveError
    io.innerRead.r.bits.last := address.len === 0.U
    when(io.innerRead.r.ready) {
      address.len := address.len - 1.U
      answersRead := address.len =/= 0.U
    }
  }
  when(io.innerRead.ar.fire && !mayRead) {
    answersRead := true.B
    address     := io.innerRead.ar.bits
  }

  // Writes
  private val discards     = RegInit(false.B)
  private val answersWrite = RegInit(false.B)
  private val id           = Reg(UInt(idBits.W))
  private val mayWrite     = isInside(io.innerWrite.aw.bits)
  io.write.aw.valid      := io.innerWrite.aw.valid && mayWrite && !discards && !answersWrite
  io.write.aw.bits       := io.innerWrite.aw.bits
  io.innerWrite.aw.ready := !discards && !answersWrite && Mux(mayWrite, io.write.aw.ready, io.writeIsIdle)
  io.write.w.valid       := io.innerWrite.w.valid && !discards
  io.write.w.bits        := io.innerWrite.w.bits
  io.innerWrite.w.ready  := discards || io.write.w.ready
  io.innerWrite.b.valid  := answersWrite || io.write.b.valid
  io.innerWrite.b.bits   := io.write.b.bits
  io.write.b.ready       := io.innerWrite.b.ready && !answersWrite
  when(answersWrite) {
    io.innerWrite.b.bits.id   := id
    io.innerWrite.b.bits.resp := Axi.slaveError
    when(io.innerWrite.b.ready) { answersWrite := false.B }
  }
  when(io.innerWrite.aw.fire && !mayWrite) {
    discards := true.B
    id       := io.innerWrite.aw.bits.id
  }
  when(discards && io.innerWrite.w.fire && io.innerWrite.w.bits.last) {
    discards     := false.B
    answersWrite := true.B
  }
}
