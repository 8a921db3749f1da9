package colonnade.traversal

import chisel3._
import chisel3.util.{Decoupled, RegEnable}
import colonnade.config.ColonnadeConfig
import colonnade.formats.Vec3
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.{PermutedFrame, TriangleRay}

/** Two products that somebody else asks of the shear's multipliers. */
final class WeighingOperands(formats: TriangleFormats) extends Bundle {
  val weights = Vec(2, UInt(formats.weightBits.W))
  val rises   = Vec(2, SInt(formats.riseBits.W))
}

final class ShearStageIO(config: ColonnadeConfig) extends Bundle {
  private val formats = new TriangleFormats(config.numbers)

  val schedule = Input(new TriangleSchedule)

  /** Vertex 0, 1, 2 in phase 0, 1, 2. */
  val vertex = Input(Vec3(UInt(config.geometry.vertexBits.W)))

  /** Stays from phase 0 to 3. */
  val ray = Input(new TriangleRay(config.numbers))

  /** x and y of that vertex relative to the ray, two cycles later. */
  val sheared = Output(Vec(2, new Fixed(formats.grid)))

  /** Of the triangle that started nine cycles ago; valid in phase 1. */
  val depths = Output(new TriangleDepths(formats))

  /** Taken when the multipliers are free; `products` of it follow in the next cycle, for one cycle. */
  val weighing = Flipped(Decoupled(new WeighingOperands(formats)))
  val products = Output(Vec(2, SInt((2 * config.numbers.gridBits).W)))
}

/** Vertices relative to the ray: translated to its origin, in its frame, sheared along it; numbers.md 4.1, 4.2.
  *
  * A vertex a cycle in phases 0 to 2: select and subtract, multiply, round and subtract. The two multipliers are lent
  * in phase 0 and while phase 1 pauses, when no product of the shear is waiting behind them.
  */
final class ShearStage(config: ColonnadeConfig) extends Module {
  val io = IO(new ShearStageIO(config))

  private val numbers  = config.numbers
  private val formats  = new TriangleFormats(numbers)
  private val schedule = io.schedule
  private val advances = schedule.advances

  // Translate: differences are within 1.5 · 2^(gridBits - 3) steps
  private val heading = io.ray.heading
  private val vertex  = PermutedFrame(io.vertex, heading.axis).map { coordinate =>
    Rounding.nearestEven(coordinate, -numbers.gridFraction).zext
  }
  private val origin     = io.ray.origin.map(_.integer)
  private val minuend    = Mux(heading.negative(2), origin(2), vertex(2))
  private val subtrahend = Mux(heading.negative(2), vertex(2), origin(2))

  private def grid(x: SInt): Fixed = Fixed(formats.grid, Rounding.narrow(x, numbers.gridBits))

  private val translated = Seq(0, 1).map(a => RegEnable(grid(vertex(a) -& origin(a)), advances))
  private val depth      = RegEnable(grid(minuend -& subtrahend), advances)

  // Multiply, for the shear or for somebody else
  private val isLent = schedule.is(0) || schedule.pauses
  io.weighing.ready := isLent
  private val products = Seq(0, 1).map { a =>
    val factor  = Mux(isLent, io.weighing.bits.weights(a).zext.pad(numbers.gridBits), io.ray.shear(a).integer)
    val stretch = Mux(isLent, io.weighing.bits.rises(a).pad(numbers.gridBits), depth.integer)
    val product = Reg(SInt((2 * numbers.gridBits).W))
    product := factor * stretch
    product
  }
  io.products.zip(products).foreach { case (port, product) => port := product }

  // Shear: the sum of two numbers within 1.5 · 2^(gridBits - 3) steps. In phase 1 nothing is on its way here.
  private val position = translated.map(RegNext(_))
  io.sheared.zip(position.zip(products)).foreach { case (port, (straight, product)) =>
    port := grid(straight.integer -& Rounding.nearestEven(product, numbers.shearFraction))
  }

  // Keep the depths until the edges are known
  private val early = Reg(new TriangleDepths(formats))
  private val rise  = {
    val Seq(here, first) = Seq(depth, early.first).map(z => Rounding.floor(z.integer, formats.commonDepthBits))
    Rounding.narrow(here -& first, formats.riseBits)
  }
  when(schedule.is(1) && advances) { early.first := depth }
  when(schedule.is(2)) { early.rises(0) := rise }
  when(schedule.is(3)) { early.rises(1) := rise }
  io.depths := RegEnable(early, schedule.is(1) && advances)
}
