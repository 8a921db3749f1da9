package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.axi.{Axi, AxiAddress, AxiReadPort, AxiWritePort}

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
  * It outlives the reset of the master, so the bus always sees whole bursts, and valid signals that hold. A beat passes
  * in one cycle. Data are offered from the second cycle after their address on, whether it has been accepted or not. At
  * most `maxBursts` bursts wait for their answers.
  */
final class AxiWriteGuard(idBits: Int, busBytes: Int, maxBursts: Int = AxiWriteGuard.maxBursts) extends Module {
  val io = IO(new AxiWriteGuardIO(idBits, busBytes))

  private val bursts = RegInit(0.U(log2Ceil(maxBursts + 1).W)) // without their answer
  private val aw     = Module(new Queue(io.axi.aw.bits.cloneType, 2))
  private val w      = Module(new Queue(io.axi.w.bits.cloneType, 2))

  // Beats that are owed for each address that has been offered, in order. They do not wait until it is accepted: a
  // memory may wait for them first (AXI4, A3.3.1).
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

/** Keeps a master's bursts in a window: one that leaves it does not reach the bus, and is answered by an error, when
  * the bursts before it have ended. Its beats are discarded, or have no value.
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
