package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.formats.Vec3
import colonnade.ray.TriangleRay

final class TriangleSequencerIO(config: ColonnadeConfig) extends Bundle {
  val schedule  = Input(new TriangleSchedule)
  val candidate = Flipped(Decoupled(new TriangleCandidate(config)))

  /** `candidate` will be ready in the next cycle. */
  val readyNext = Output(Bool())

  /** The vertex of this phase (phases 0 to 2) if `tag` is valid; otherwise it does not change. */
  val vertex = Output(Vec3(UInt(config.geometry.vertexBits.W)))

  /** Constant from phase 0 to 3. */
  val ray = Output(new TriangleRay(config.numbers))

  /** The current triangle, from phase 0 to 3. */
  val tag = Output(Valid(new TriangleTag(config)))
}

/** Sequences the triangles of a record: one triangle per round of the schedule, one vertex per phase.
  *
  * A candidate is accepted in phase 3 and starts in the next cycle, so records follow each other without a lost round.
  * A record with an illegal `count` gives one absent triangle.
  */
final class TriangleSequencer(config: ColonnadeConfig) extends Module {
  val io = IO(new TriangleSequencerIO(config))

  private val perRecord = config.geometry.trianglesPerRecord
  private val indexBits = log2Ceil(perRecord).max(1)

  private val isOccupied = RegInit(false.B)
  private val candidate  = Reg(new TriangleCandidate(config))
  private val index      = Reg(UInt(indexBits.W))

  private val record = candidate.record
  private val isLast = index === (perRecord - 1).U || index +& 1.U >= record.count || !record.isLegal
  private val isEnd  = io.schedule.is(3)

  private val isFree = !isOccupied || isLast
  io.candidate.ready := isEnd && isFree
  io.readyNext       := io.schedule.is(2) && isFree
  when(isEnd) {
    index := index + 1.U
    when(io.candidate.ready) {
      isOccupied := io.candidate.valid
      index      := 0.U
    }
  }
  when(io.candidate.fire) { candidate := io.candidate.bits }

  private val triangles = record.vertices.grouped(3).toSeq
  private val vertices  = (0 until 3).map { vertex =>
    triangles.zipWithIndex.tail.foldLeft(triangles.head(vertex)) { case (other, (triangle, k)) =>
      Mux(index === k.U, triangle(vertex), other)
    }
  }
  private def issues(vertex: Int): Bool = isOccupied && io.schedule.is(vertex)
  io.vertex := Mux(issues(0), vertices(0), Mux(issues(1), vertices(1), vertices(2)))
  io.ray    := candidate.ray

  io.tag.valid               := isOccupied
  io.tag.bits.context        := candidate.context
  io.tag.bits.id             := record.firstTriangle + index
  io.tag.bits.isLast         := isLast
  io.tag.bits.isTransmissive := triangles.indices.tail.foldLeft(record.isClear(0)) { case (other, k) =>
    Mux(index === k.U, record.isClear(k), other)
  }
  io.tag.bits.isAbsent   := !record.isLegal
  io.tag.bits.isNegative := candidate.ray.orientation.negative(2)
}
