package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.config.PartConfig
import colonnade.formats.{TrianglesRecord, Vec3}
import colonnade.ray.TriangleRay

final class TriangleSequencerIO(config: PartConfig) extends Bundle {
  val candidate = Flipped(Decoupled(new TriangleCandidate(config)))
  val readyNext = Output(Bool()) // `candidate` will be ready in the next cycle
  val advances  = Input(Bool())  // the stages after this one accept `slot`
  val slot      = Output(new TriangleSlot)

  /** The vertex of `slot`, to be loaded in this cycle even if the pipeline stalls. */
  val vertex = Valid(Vec3(UInt(config.geometry.vertexBits.W)))
  val ray    = Output(new TriangleRay(config.numbers))

  /** The current round; valid with the vertex of its last slot. */
  val tag = Valid(new TriangleTag(config))
}

/** Sequences the triangles of a record in rounds: 4 slots for a triangle, 5 for a pair that shares an edge;
  * docs/traversal.md, triangle test.
  *
  * The gap frees the first register of the pipeline, so the last vertex never waits, and a record's end is known one cycle
  * before. The next candidate is accepted with the last vertex, so no slot is lost between records. Without a record, a
  * candidate is accepted in every second cycle. A record with an illegal `count` gives one absent triangle.
  */
final class TriangleSequencer(config: PartConfig) extends Module {
  val io = IO(new TriangleSequencerIO(config))

  import TriangleStep._

  private val perRecord = TrianglesRecord.most
  private val indexBits = log2Ceil(perRecord).max(1)

  private val candidate = Reg(new TriangleCandidate(config))
  private val record    = candidate.record
  private val triangles = record.vertices.grouped(3).toSeq
  private val index     = Reg(UInt(indexBits.W))
  private val hasRecord = RegInit(false.B) // the candidate has vertices to issue

  // The second triangle of the record starts with an edge of the first one, reversed
  private val sharesEdge = triangles match {
    case Seq(first, second) =>
      record.count === 2.U && index === 0.U &&
      first(0).asUInt === second(1).asUInt && first(1).asUInt === second(0).asUInt
    case _ => false.B
  }

  // Slots
  private val step      = RegInit(idle)
  private val isPair    = Reg(Bool())
  private val isLoaded  = RegNext(step === last && !io.advances, false.B)
  private val issues    = step === last && !isLoaded
  private val isEnd     = isPair || index === (perRecord - 1).U || index +& 1.U >= record.count || !record.isLegal
  private val continues = Mux(issues, !isEnd, hasRecord) || io.candidate.fire
  when(step === idle) {
    when(io.candidate.fire) { step := first }
  }.elsewhen(io.advances) {
    when(step === first) { step := second }
    when(step === second) { step := Mux(sharesEdge, third, gap) }
    when(step === third) { step := gap }
    when(step === gap) { step := last }
    when(step === last) { step := Mux(continues, first, idle) }
  }
  when(step === second) { isPair := sharesEdge }
  when(issues) {
    hasRecord := !isEnd
    when(!isEnd) { index := index + 1.U }
  }
  when(io.candidate.fire) {
    candidate := io.candidate.bits
    hasRecord := true.B
    index     := 0.U
  }

  // A candidate is accepted with the last vertex of a record, or without a record
  private val isOpen = RegNext(io.readyNext, false.B)
  io.candidate.ready := isOpen
  // With extra slices after the last vertex: then no path leads from the pipeline to the record fetch
  private val ends = if (config.units.extraSlices) issues && isEnd else step === gap && io.advances && isEnd
  io.readyNext := ends || (!hasRecord && !isOpen)

  private def vertexOf(triangle: UInt, vertex: Int): Vec3[UInt] =
    triangles.zipWithIndex.tail.foldLeft(triangles.head(vertex)) { case (other, (each, k)) =>
      Mux(triangle === k.U, each(vertex), other)
    }
  io.slot.step    := step
  io.slot.isPair  := isPair
  io.vertex.valid := Mux(step === last, issues, io.advances && step =/= idle && step =/= gap)
  io.vertex.bits  := Mux(
    step === first,
    vertexOf(index, 0),
    Mux(step === second, vertexOf(index, 1), vertexOf(Mux(isPair && step =/= third, 1.U, index), 2))
  )
  io.ray := candidate.ray

  io.tag.valid               := issues
  io.tag.bits.context        := candidate.context
  io.tag.bits.id             := candidate.address ## index
  io.tag.bits.isLast         := isEnd
  io.tag.bits.isPair         := isPair
  io.tag.bits.isTransmissive := VecInit(
    triangles.indices.tail.foldLeft(record.isClear(0)) { case (other, k) =>
      Mux(index === k.U, record.isClear(k), other)
    },
    record.isClear.last
  )
  io.tag.bits.isAbsent   := !record.isLegal
  io.tag.bits.isNegative := candidate.ray.orientation.negative(2)
}
