package colonnade.traversal

import chisel3._
import chisel3.util.RegEnable
import colonnade.config.NumberFormats
import colonnade.numbers.{Fixed, Rounding}

final class EdgeStageIO(formats: TriangleFormats) extends Bundle {
  val schedule = Input(new TriangleSchedule)

  /** x and y of vertices 0, 1, 2 in phases 2, 3, 0. */
  val sheared = Input(Vec(2, new Fixed(formats.grid)))

  /** The ray's line crosses the triangle whose vertex 0 came seven cycles ago. All outputs are valid in phase 1. */
  val crossesTriangle = Output(Bool())
  val isPositive      = Output(Bool())
  val magnitudes      = Output(Vec(3, UInt(formats.edgeBits.W)))
}

/** Exact edge functions of the sheared triangle; numbers.md 4.3.
  *
  * It multiplies in phases 0, 1, 2 (edges 2, 0, 1), then subtracts and tests the signs in the two cycles that follow.
  * A triangle seen edge-on, whose edge functions are all zero, is not crossed.
  */
final class EdgeStage(numbers: NumberFormats) extends Module {
  private val formats = new TriangleFormats(numbers)
  val io              = IO(new EdgeStageIO(formats))

  private val schedule = io.schedule
  private val advances = schedule.advances

  // The last three vertices; the oldest one comes again to close the triangle
  private val current, previous, oldest = Reg(Vec(2, new Fixed(formats.grid)))
  when(advances) {
    current  := Mux(schedule.is(1), oldest, io.sheared)
    previous := current
    oldest   := previous
  }
  private val forward  = RegEnable(previous(0).integer * current(1).integer, advances)
  private val backward = RegEnable(previous(1).integer * current(0).integer, advances)

  // The three edges; the older two are kept as magnitudes. They hold in phase 0
  private val edge          = Reg(SInt(formats.edgeBits.W))
  private val edge0, edge2  = Reg(UInt(formats.edgeBits.W))
  private val edgeMagnitude = edge.abs.asUInt
  when(advances && !schedule.is(0)) {
    edge  := Rounding.narrow(forward -& backward, formats.edgeBits)
    edge0 := edgeMagnitude
    edge2 := edge0
  }

  private val anyNegative, anyPositive = Reg(Bool())
  when(!schedule.is(1)) {
    val isFirst = schedule.is(2)
    anyNegative := edge < 0.S || (anyNegative && !isFirst)
    anyPositive := edge > 0.S || (anyPositive && !isFirst)
  }

  io.crossesTriangle := anyNegative =/= anyPositive
  io.isPositive      := anyPositive
  io.magnitudes      := VecInit(edge0, edgeMagnitude, edge2)
}
