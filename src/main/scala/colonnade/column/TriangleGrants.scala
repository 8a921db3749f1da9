package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, RegEnable}
import colonnade.common.RoundRobin

final class TriangleGrantsIO(count: Int) extends Bundle {
  val waits = Input(UInt(count.W)) // by row: a record waits

  /** Records in the queue, at most [[TriangleGroup.queueDepth]], and whether a triangle unit takes one in the next cycle. */
  val queued    = Input(UInt(log2Ceil(TriangleGroup.queueDepth + 1).W))
  val readyNext = Input(Bool())

  /** The row, if any, that may send a record in the next cycle. */
  val grant = Output(UInt(count.W))

  /** The row, if any, whose record comes in this cycle, if it sends one. */
  val sender = Output(UInt(count.W))
}

/** Grants places in the queue of [[TriangleGroup]] to rows, one cycle before a record comes and one cycle after the row
  * was chosen. So a record never comes to a full queue. A row that keeps waiting is one of the next `count` chosen.
  */
final class TriangleGrants(count: Int) extends Module {
  val io = IO(new TriangleGrantsIO(count))

  private val arbiter = Module(new RoundRobin(count)).io
  private val chosen  = RegInit(0.U(count.W))
  private val isOpen  = RegInit(false.B)
  private val moves   = RegNext(io.readyNext, false.B)

  // The queue has a place in the next cycle, beside the record that comes now
  private val hasPlace = io.queued +& isOpen < TriangleGroup.queueDepth.U +& moves
  arbiter.requests := io.waits & ~Mux(hasPlace, chosen, 0.U)
  arbiter.isTaken  := hasPlace || !chosen.orR
  when(arbiter.isTaken) { chosen := arbiter.grant }
  isOpen := hasPlace && chosen.orR

  io.grant  := Mux(hasPlace, chosen, 0.U)
  io.sender := Mux(isOpen, RegEnable(chosen, hasPlace), 0.U)
}
