package colonnade.traversal

import chisel3._
import chisel3.util.RegEnable
import colonnade.config.NumberFormats
import colonnade.numbers.{Fixed, Rounding}

final class EdgeStageIO(formats: TriangleFormats) extends Bundle {
  val schedule = Input(new TriangleSchedule)

  /** x and y of vertices 0, 1, 2 in phases 2, 3, 0. */
  val sheared = Input(Vec(2, new Fixed(formats.grid)))

  /** A triangle comes in this round of phases 2, 3, 0, 1; and one came in the round before. */
  val isOccupied  = Input(Bool())
  val wasOccupied = Input(Bool())

  /** The ray's line crosses the triangle whose vertex 0 came seven cycles ago. All outputs are valid in phase 1. */
  val crossesTriangle = Output(Bool())
  val isPositive      = Output(Bool())
  val magnitudes      = Output(Vec(3, UInt(formats.edgeBits.W)))
}

/** Exact edge functions of the sheared triangle; numbers.md 4.3.
  *
  * It multiplies in phases 0, 1, 2 (edges 2, 0, 1), then subtracts and tests the signs in the two cycles that follow.
  * A triangle seen edge-on, whose edge functions are all zero, is not crossed. Without a triangle the registers hold,
  * and in phase 3 so do the operands of the multipliers.
  */
final class EdgeStage(numbers: NumberFormats) extends Module {
  private val formats = new TriangleFormats(numbers)
  val io              = IO(new EdgeStageIO(formats))

  private val schedule = io.schedule
  private val advances = schedule.advances

  // The edge's two vertices. The first one waits until the second one comes, and comes again to close the triangle
  private val current, previous, first = Reg(Vec(2, new Fixed(formats.grid)))
  when(io.isOccupied && advances) {
    when(schedule.is(2)) {
      first := io.sheared
    }.otherwise {
      current  := Mux(schedule.is(1), first, io.sheared)
      previous := Mux(schedule.is(3), first, current)
    }
  }
  private val multiplies = advances && !schedule.is(3) && Mux(schedule.is(2), io.wasOccupied, io.isOccupied)
  private val forward    = RegEnable(previous(0).integer * current(1).integer, multiplies)
  private val backward   = RegEnable(previous(1).integer * current(0).integer, multiplies)

  // The three edges; the older two are kept as magnitudes. They hold in phase 0
  private val edge          = Reg(SInt(formats.edgeBits.W))
  private val edge0, edge2  = Reg(UInt(formats.edgeBits.W))
  private val edgeMagnitude = edge.abs.asUInt
  when(advances && !schedule.is(0) && Mux(schedule.is(1), io.isOccupied, io.wasOccupied)) {
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
