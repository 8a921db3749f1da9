package colonnade.refit

import chisel3._
import chisel3.util._
import colonnade.config.ColonnadeConfig

/** A vertex of a leaf, or a node. */
final class RefitStep(config: ColonnadeConfig) extends Bundle {
  val entry  = new RefitEntry(config)
  val vertex = new RefitVertex(config)
  val index  = UInt(2.W) // of the vertex in its leaf
  val isLast = Bool()    // of its entry
}

final class VertexRingIO(config: ColonnadeConfig) extends Bundle {
  val start   = Input(Bool())                               // the next line is the first of a plan
  val entries = Flipped(Decoupled(new RefitEntry(config)))
  val data    = Flipped(Valid(UInt(RefitPlan.entryBits.W))) // of vertices, line by line
  val retired = Output(UInt(2.W))                           // lines that an entry has waited for
  val steps   = Decoupled(new RefitStep(config))
  val isIdle  = Output(Bool())
}

/** Holds the last lines of vertices, and gives each leaf its own, one a cycle. Its entries wait for lines that have not
  * come.
  */
final class VertexRing(config: ColonnadeConfig) extends Module {
  val io = IO(new VertexRingIO(config))

  private val memory = SyncReadMem(1 << RingSlot.bits, UInt((new RefitVertex(config)).getWidth.W))
  private val write  = RegInit(0.U(RingSlot.bits.W))
  private val held   =
    RegInit(0.U((log2Ceil(RefitPlan.linesInFlight * RefitPlan.lineEntries) + 1).W)) // unclaimed vertices
  when(io.data.valid) {
    memory.write(write, RefitVertex(config, io.data.bits).asUInt)
    write := write + 1.U
  }
  when(io.start) { write := 0.U }

  // The memory is read again while its vertex waits
  private val entry   = io.entries.bits
  private val isLines = entry.kind === RefitKind.lines
  private val isNode  = entry.kind === RefitKind.node
  private val index   = RegInit(0.U(2.W))
  private val isLast  = isNode || index === Mux(entry.kind === RefitKind.pair, 3.U, 2.U)
  private val step    = Reg(new RefitStep(config))
  private val hasStep = RegInit(false.B)
  private val isRead  = RegInit(false.B) // the memory has the step's vertex
  private val moves   = !isRead || (!hasStep || io.steps.ready)
  private val reads   = io.entries.valid && !isLines && moves
  private val claimed = entry.count ## 0.U(log2Ceil(RefitPlan.lineEntries).W)
  private val hasCome = held >= claimed
  private val retires = io.entries.valid && isLines && hasCome
  io.entries.ready := Mux(isLines, hasCome, moves && isLast)
  io.retired       := Mux(retires, entry.count, 0.U)
  held             := held + io.data.valid - Mux(retires, claimed, 0.U)
  when(reads) { index := Mux(isLast, 0.U, index + 1.U) }

  private val reading = Reg(new RefitStep(config))
  private val slot    = Reg(UInt(RingSlot.bits.W))
  private val at      = Mux(moves, entry.slot(index), slot)
  private val vertex  = memory.read(at)
  when(moves) {
    isRead         := reads
    slot           := at
    reading.entry  := entry
    reading.index  := index
    reading.isLast := isLast
  }
  when(!hasStep || io.steps.ready) {
    hasStep     := isRead
    step        := reading
    step.vertex := vertex.asTypeOf(step.vertex)
  }
  io.steps.valid := hasStep
  io.steps.bits  := step
  io.isIdle      := !isRead && !hasStep
}
