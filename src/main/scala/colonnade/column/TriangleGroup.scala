package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, Cat, Mux1H, OHToUInt, Queue, RegEnable}
import colonnade.common.RoundRobin
import colonnade.config.{ColonnadeConfig, TraversalConfig, TriangleGroupConfig}
import colonnade.traversal.{TriangleCandidate, TriangleLanes, TriangleLanesIO}

final class TriangleGroupIO(config: ColonnadeConfig, count: Int) extends Bundle {

  /** By row. `busy` of the first row counts for all. */
  val rows = Vec(count, new TriangleLanesIO(TraversalConfig(config)))

  val waits = Input(Vec(count, Bool())) // by row: a record waits for a triangle unit
}

/** Triangle units of a group of rows: docs/traversal.md, triangle groups. A row is chosen one cycle before it may grant
  * a record to a context, so a record takes three cycles more than in a group of one row, and its results one.
  * Throughput: a record and a result per cycle. A row that keeps waiting is one of the next `count` chosen.
  *
  * @param count rows
  */
final class TriangleGroup(config: ColonnadeConfig, count: Int) extends Module {
  val io = IO(new TriangleGroupIO(config, count))

  private val shared = TriangleGroupConfig(config)
  private val lanes  = Module(new TriangleLanes(shared)).io
  if (config.sharesTriangleUnits) share() else io.rows.head :<>= lanes

  private def share(): Unit = {
    val rowBits = log2Ceil(config.units.triangleRows)
    val queue   = Module(new Queue(new TriangleCandidate(shared), TriangleGroup.queueDepth, flow = true)).io

    // Choose a row, and take its record; its number stands in front of the context
    val grants = Module(new TriangleGrants(count)).io
    grants.waits           := io.waits.asUInt
    grants.queued          := queue.count
    grants.readyNext       := lanes.readyNext
    queue.enq.valid        := Mux1H(grants.sender, io.rows.map(_.candidate.valid))
    queue.enq.bits         := Mux1H(grants.sender, io.rows.map(_.candidate.bits))
    queue.enq.bits.context :=
      Cat(0.U(rowBits.W) | OHToUInt(grants.sender), Mux1H(grants.sender, io.rows.map(_.candidate.bits.context)))
    for ((row, index) <- io.rows.zipWithIndex) {
      row.readyNext       := grants.grant(index)
      row.candidate.ready := grants.sender(index)
    }
    lanes.candidate :<>= queue.deq
    assert(!queue.enq.valid || queue.enq.ready, "a record comes to a full queue of triangles")

    // Return results to their rows
    val results = Queue(lanes.result, 1, pipe = true)
    val owner   = results.bits.context >> (results.bits.context.getWidth - rowBits)
    for ((row, index) <- io.rows.zipWithIndex) {
      row.result.valid := results.valid && owner === index.U
      row.result.bits  := results.bits
      row.busy         := (if (index == 0) lanes.busy else 0.U)
    }
    results.ready := Mux1H(io.rows.zipWithIndex.map { case (row, index) => (owner === index.U) -> row.result.ready })
  }
}

object TriangleGroup {
  val queueDepth: Int = 1 // records that wait for a triangle unit
}

final class TriangleGrantsIO(count: Int) extends Bundle {
  val waits = Input(UInt(count.W)) // by row: a record waits

  /** Records in the queue, at most [[TriangleGroup.queueDepth]], and whether a triangle unit takes one in the next
    * cycle.
    */
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
