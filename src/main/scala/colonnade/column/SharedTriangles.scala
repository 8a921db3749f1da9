package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, Cat, Mux1H, OHToUInt, Queue}
import colonnade.config.ColonnadeConfig
import colonnade.traversal.{TriangleCandidate, TriangleLanes, TriangleLanesIO}

/** Ports of [[SharedTriangles]]. */
final class SharedTrianglesIO(config: ColonnadeConfig, count: Int) extends Bundle {

  /** By row. `busy` of the first row counts for all. */
  val rows = Vec(count, new TriangleLanesIO(config))

  /** By row: a record waits for a triangle unit. */
  val waits = Input(Vec(count, Bool()))
}

/** Triangle units that several rows share: docs/triangle.md. {{{
  * rows ─ candidate, row ─▶ queue ─▶ TriangleLanes ─ result, row ─▶ register ─▶ rows
  * }}}
  * A row is chosen one cycle before it may grant a record to a context, so a record takes three cycles more than with a
  * unit of its own, and its results one. Throughput: a record and a result per cycle. A row that keeps waiting is one of the
  * next `count` chosen.
  *
  * @param count rows
  */
final class SharedTriangles(config: ColonnadeConfig, count: Int) extends Module {
  val io = IO(new SharedTrianglesIO(config, count))

  private val shared  = config.ofTriangleRows
  private val rowBits = log2Ceil(config.units.triangleRows)
  private val lanes   = Module(new TriangleLanes(shared)).io
  private val queue   = Module(new Queue(new TriangleCandidate(shared), SharedTriangles.places, flow = true)).io

  // Choose a row, and take its record
  private val grants = Module(new TriangleGrants(count)).io
  grants.waits     := io.waits.asUInt
  grants.queued    := queue.count
  grants.readyNext := lanes.readyNext
  queue.enq.valid  := Mux1H(grants.sender, io.rows.map(_.candidate.valid))
  queue.enq.bits   := Mux1H(grants.sender, io.rows.map(row => widened(row.candidate.bits, grants.sender)))
  for ((row, index) <- io.rows.zipWithIndex) {
    row.readyNext       := grants.grant(index)
    row.candidate.ready := grants.sender(index)
  }
  lanes.candidate :<>= queue.deq

  // Return results to their rows
  private val results = Queue(lanes.result, 1, pipe = true)
  private val owner   = results.bits.context >> (results.bits.context.getWidth - rowBits)
  for ((row, index) <- io.rows.zipWithIndex) {
    row.result.valid := results.valid && owner === index.U
    row.result.bits  := results.bits
    row.busy         := (if (index == 0) lanes.busy else 0.U)
  }
  results.ready := VecInit(io.rows.zipWithIndex.map { case (row, index) =>
    row.result.ready && owner === index.U
  }).asUInt.orR

  assert(!queue.enq.valid || queue.enq.ready, "a record comes to a full queue of triangles")

  /** The candidate with its row in front of its context. */
  private def widened(candidate: TriangleCandidate, row: UInt): TriangleCandidate = {
    val to = Wire(new TriangleCandidate(shared))
    to         := candidate
    to.context := Cat(OHToUInt(row).pad(rowBits), candidate.context)
    to
  }
}

object SharedTriangles {

  /** Records that wait for a triangle unit. */
  val places: Int = 1
}
