package colonnade.traversal

import chisel3._
import chisel3.util.{RegEnable, Valid}
import colonnade.config.{NumberFormats, PartConfig}
import colonnade.formats.Vec3
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.{PermutedFrame, TriangleRay}

final class ShearStageIO(config: PartConfig) extends Bundle {
  private val formats = new TriangleFormats(config.numbers)

  val advances = Input(Bool()) // the pipeline moves by a slot
  val slot     = Input(new TriangleSlot)

  /** The vertex of `slot` and its ray. */
  val vertex = Flipped(Valid(Vec3(UInt(config.device.geometry.vertexBits.W))))
  val ray    = Input(new TriangleRay(config.numbers))

  /** The slot two slots later, with x and y of its vertex relative to the ray. */
  val shearedSlot = Output(new TriangleSlot)
  val sheared     = Output(Vec(2, new Fixed(formats.grid)))

  /** Depths of a round's triangle, or of its pair, from the slot after its last vertex is sheared to the next
    * round's.
    */
  val depths = Output(Vec(2, new TriangleDepths(formats)))
}

/** Transforms vertices to the ray's frame: translation to its origin, permutation of axes, shear; numbers.md 4.1, 4.2.
  *
  * One vertex per slot: select and subtract, multiply, round and subtract. Without a vertex the registers hold.
  */
final class ShearStage(config: PartConfig) extends Module {
  val io = IO(new ShearStageIO(config))

  import TriangleStep._

  private val numbers  = config.numbers
  private val formats  = new TriangleFormats(numbers)
  private val advances = io.advances
  private val none     = 0.U.asTypeOf(new TriangleSlot)

  // Translate: differences are within 1.5 · 2^(gridBits - 3) steps
  private val orientation = io.ray.orientation
  private val vertex      = PermutedFrame(io.vertex.bits, orientation.axis).map { coordinate =>
    Rounding.nearestEven(coordinate, -numbers.gridFraction).zext
  }
  private val origin     = io.ray.origin.map(_.integer)
  private val minuend    = Mux(orientation.negative(2), origin(2), vertex(2))
  private val subtrahend = Mux(orientation.negative(2), vertex(2), origin(2))

  private def grid(x: SInt): Fixed = Fixed(formats.grid, Rounding.narrow(x, numbers.gridBits))

  private val translated = Seq(0, 1).map(a => RegEnable(grid(vertex(a) -& origin(a)), io.vertex.valid))
  private val depth      = RegEnable(grid(minuend -& subtrahend), io.vertex.valid)
  private val factors    = RegEnable(io.ray.shear, io.vertex.valid && io.slot.step === first)
  private val slot       = RegEnable(io.slot, none, advances)

  // Multiply
  private val multiplies = advances && slot.step =/= idle && slot.step =/= gap
  private val products   = factors.map(factor => RegEnable(factor.integer * depth.integer, multiplies))
  private val positions  = translated.map(RegEnable(_, multiplies))
  io.shearedSlot := RegEnable(slot, none, advances)

  // Shear: the sum of two numbers within 1.5 · 2^(gridBits - 3) steps
  io.sheared.zip(positions.zip(products)).foreach { case (port, (position, product)) =>
    port := grid(position.integer -& Rounding.nearestEven(product, numbers.shearFraction))
  }

  // Keep the depths until the edges are known: the first vertex's, and the rises of the others
  private val early = Reg(new PairDepths(formats))
  private val rise  = {
    val Seq(here, start) = Seq(depth, early.first).map(z => Rounding.floor(z.integer, formats.commonDepthBits))
    Rounding.narrow(here -& start, formats.riseBits)
  }
  when(advances) {
    when(slot.step === first) { early.first := depth }
    when(slot.step === second) { early.rises(0) := rise }
    when(slot.step === third || (slot.step === last && !slot.isPair)) { early.rises(1) := rise }
    when(slot.step === last && slot.isPair) { early.rises(2) := rise }
  }
  private val late = RegEnable(early, advances && io.shearedSlot.step === last)

  // The second triangle of a pair starts with vertices 1 and 0 of the first one
  private val Seq(toSecond, toThird, toFourth) = late.rises.toSeq
  io.depths(0).first := late.first
  io.depths(0).rises := VecInit(toSecond, toThird)
  io.depths(1).first := grid(late.first.integer +& Rounding.floor(toSecond, -formats.commonDepthBits))
  io.depths(1).rises := VecInit(Seq(0.S -& toSecond, toFourth -& toSecond).map(Rounding.narrow(_, formats.riseBits)))
}

/** Depths of the vertices of a triangle, or of a pair of triangles, along the ray's dominant axis. */
final private class PairDepths(formats: TriangleFormats) extends Bundle {
  val first = new Fixed(formats.grid)

  /** Rises of vertices 1 and 2, and in a pair of the second triangle's vertex 2. */
  val rises = Vec(3, SInt(formats.riseBits.W))
}

final class EdgeStageIO(formats: TriangleFormats) extends Bundle {
  val advances = Input(Bool())                          // the pipeline moves by a slot
  val slot     = Input(new TriangleSlot)
  val sheared  = Input(Vec(2, new Fixed(formats.grid))) // x and y of the vertex of `slot`

  /** All edges of a triangle are known, and the other outputs valid: it is the second one of a pair; the ray's line
    * crosses it.
    */
  val decides         = Output(Bool())
  val isSecond        = Output(Bool())
  val crossesTriangle = Output(Bool())
  val isPositive      = Output(Bool())
  val magnitudes      = Output(Vec(3, UInt(formats.edgeBits.W)))
}

/** Exact edge functions of the sheared triangles; numbers.md 4.3.
  *
  * One edge per slot, in the order 2, 0, 1: load two vertices, multiply, subtract, test the sign. The triangle is
  * decided with its edge 1, four slots after its last vertex came. The second triangle of a pair needs only edges 0 and
  * 1: its edge 2 is the first one's, negated. A triangle seen edge-on, whose edge functions are all zero, is not
  * crossed. Without a triangle the registers hold.
  */
final class EdgeStage(numbers: NumberFormats) extends Module {
  private val formats = new TriangleFormats(numbers)
  val io              = IO(new EdgeStageIO(formats))

  import TriangleStep._

  private val advances = io.advances
  private val step     = io.slot.step

  // Which edge the vertex of this slot completes; the slot after the last one closes its triangle
  private val none    = 0.U.asTypeOf(new EdgeSlot)
  private val closes  = RegEnable(step === last, false.B, advances)
  private val isPair  = RegEnable(io.slot.isPair, advances)
  private val loading = Wire(new EdgeSlot)
  loading.edge2    := step === second
  loading.edge0    := step === third || step === last
  loading.edge1    := closes || (step === gap && io.slot.isPair)
  loading.isSecond := closes && isPair
  private val loads = loading.edge2 || loading.edge0 || loading.edge1

  // The edge's two vertices. The round's first two wait, to close the triangles
  private val current, previous, firstVertex, secondVertex = Reg(Vec(2, new Fixed(formats.grid)))
  when(advances) {
    when(step === first) { firstVertex := io.sheared }
    when(step === second) { secondVertex := io.sheared }
    when(loads) {
      current  := Mux(loading.edge1, Mux(loading.isSecond, secondVertex, firstVertex), io.sheared)
      previous := Mux(loading.edge2, firstVertex, current)
    }
  }

  // Multiply, then subtract
  private val multiplying = RegEnable(loading, none, advances)
  private val subtracting = RegEnable(multiplying, none, advances)
  private val testing     = RegEnable(subtracting, none, advances)
  private val multiplies  = advances && multiplying.isValid
  private val subtracts   = advances && subtracting.isValid
  private val forward     = RegEnable(previous(0).integer * current(1).integer, multiplies)
  private val backward    = RegEnable(previous(1).integer * current(0).integer, multiplies)
  private val edge        = RegEnable(Rounding.narrow(forward -& backward, formats.edgeBits), subtracts)
  private val isZero      = RegEnable(forward === backward, subtracts)

  // The three edges; the older two are kept as magnitudes and signs. A pair's edge is negated for its second triangle
  private val magnitude                                  = edge.abs.asUInt
  private val isNegative                                 = edge < 0.S
  private val isPositive                                 = !isNegative && !isZero
  private def keep[T <: Data](value: T, isEdge: Bool): T = RegEnable(value, advances && isEdge)
  private val (magnitude2, magnitude0) = (keep(magnitude, testing.edge2), keep(magnitude, testing.edge0))
  private val (negative2, negative0)   = (keep(isNegative, testing.edge2), keep(isNegative, testing.edge0))
  private val (positive2, positive0)   = (keep(isPositive, testing.edge2), keep(isPositive, testing.edge0))
  private val anyNegative              = isNegative || negative0 || Mux(testing.isSecond, positive2, negative2)
  private val anyPositive              = isPositive || positive0 || Mux(testing.isSecond, negative2, positive2)

  io.decides         := testing.edge1
  io.isSecond        := testing.isSecond
  io.crossesTriangle := anyNegative =/= anyPositive
  io.isPositive      := anyPositive
  io.magnitudes      := VecInit(magnitude0, magnitude, magnitude2)
}

/** The edge function that a stage computes; at most one of the first three. */
final private class EdgeSlot extends Bundle {
  val edge2, edge0, edge1 = Bool()
  val isSecond            = Bool() // with `edge1`: of the second triangle of a pair

  def isValid: Bool = edge2 || edge0 || edge1
}
