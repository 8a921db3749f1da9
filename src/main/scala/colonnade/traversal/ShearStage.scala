package colonnade.traversal

import chisel3._
import chisel3.util.{Decoupled, RegEnable}
import colonnade.config.ColonnadeConfig
import colonnade.formats.Vec3
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.{PermutedFrame, TriangleRay}

/** Operands of the numerator stage for the two multipliers that it shares with the shear. */
final class WeighingOperands(formats: TriangleFormats) extends Bundle {
  val weights = Vec(2, UInt(formats.weightBits.W))
  val rises   = Vec(2, SInt(formats.riseBits.W))
}

final class ShearStageIO(config: ColonnadeConfig) extends Bundle {
  private val formats = new TriangleFormats(config.numbers)

  val schedule = Input(new TriangleSchedule)

  /** Vertex 0, 1, 2 in phase 0, 1, 2, if `isOccupied`. */
  val vertex     = Input(Vec3(UInt(config.geometry.vertexBits.W)))
  val isOccupied = Input(Bool())

  /** Constant from phase 0 to 3. */
  val ray = Input(new TriangleRay(config.numbers))

  /** x and y of the vertex relative to the ray, two cycles after it came. */
  val sheared = Output(Vec(2, new Fixed(formats.grid)))

  /** Depths of the triangle that started nine cycles ago; valid in phase 1. */
  val depths = Output(new TriangleDepths(formats))

  /** Accepted when the multipliers are free; `products` is valid in the next cycle only. */
  val weighing = Flipped(Decoupled(new WeighingOperands(formats)))
  val products = Output(Vec(2, SInt((2 * config.numbers.gridBits).W)))
}

/** Transforms vertices to the ray's frame: translation to its origin, permutation of axes, shear; numbers.md 4.1, 4.2.
  *
  * One vertex per cycle in phases 0 to 2: select and subtract, multiply, round and subtract. The numerator stage may use
  * the two multipliers in phase 0 and while phase 1 pauses, when the shear has no product in flight. Without a triangle
  * the registers hold, and without a request of the numerator stage so do the operands of the multipliers.
  */
final class ShearStage(config: ColonnadeConfig) extends Module {
  val io = IO(new ShearStageIO(config))

  private val numbers  = config.numbers
  private val formats  = new TriangleFormats(numbers)
  private val schedule = io.schedule
  private val advances = schedule.advances

  // Translate: differences are within 1.5 · 2^(gridBits - 3) steps
  private val orientation = io.ray.orientation
  private val vertex      = PermutedFrame(io.vertex, orientation.axis).map { coordinate =>
    Rounding.nearestEven(coordinate, -numbers.gridFraction).zext
  }
  private val origin     = io.ray.origin.map(_.integer)
  private val minuend    = Mux(orientation.negative(2), origin(2), vertex(2))
  private val subtrahend = Mux(orientation.negative(2), vertex(2), origin(2))

  private def grid(x: SInt): Fixed = Fixed(formats.grid, Rounding.narrow(x, numbers.gridBits))

  private val translated = Seq(0, 1).map(a => RegEnable(grid(vertex(a) -& origin(a)), advances && io.isOccupied))
  private val depth      = RegEnable(grid(minuend -& subtrahend), advances && io.isOccupied)

  // A vertex follows its translation by one cycle; the sequencer's occupation changes after phase 3
  private val holdsVertex = RegEnable(io.isOccupied, advances)

  // Multiply, for the shear or for the numerator stage
  private val isShared = schedule.is(0) || schedule.pauses
  io.weighing.ready := isShared
  private val weighs   = io.weighing.fire
  private val shears   = holdsVertex && advances && !schedule.is(0)
  private val products = Seq(0, 1).map { a =>
    val factor  = Mux(weighs, io.weighing.bits.weights(a).zext.pad(numbers.gridBits), io.ray.shear(a).integer)
    val stretch = Mux(weighs, io.weighing.bits.rises(a).pad(numbers.gridBits), depth.integer)
    RegEnable(factor * stretch, weighs || shears)
  }
  io.products.zip(products).foreach { case (port, product) => port := product }

  // Shear: the sum of two numbers within 1.5 · 2^(gridBits - 3) steps. In phase 1 no product arrives.
  private val position = translated.map(RegEnable(_, shears))
  io.sheared.zip(position.zip(products)).foreach { case (port, (straight, product)) =>
    port := grid(straight.integer -& Rounding.nearestEven(product, numbers.shearFraction))
  }

  // Keep the depths until the edges are known
  private val early = Reg(new TriangleDepths(formats))
  private val rise  = {
    val Seq(here, first) = Seq(depth, early.first).map(z => Rounding.floor(z.integer, formats.commonDepthBits))
    Rounding.narrow(here -& first, formats.riseBits)
  }
  when(holdsVertex) {
    when(schedule.is(1) && advances) { early.first := depth }
    when(schedule.is(2)) { early.rises(0) := rise }
    when(schedule.is(3)) { early.rises(1) := rise }
  }
  io.depths := RegEnable(early, schedule.is(1) && advances)
}
