package colonnade.instance

import chisel3._
import chisel3.util.{Decoupled, RegEnable, Valid}
import colonnade.common.{Context, DelayLine}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{InstanceNumber, ObjectInstance, Vec3}
import colonnade.numbers.{Fixed, Normalise, Normalised, Rounding}
import colonnade.ray.{PermutedFrame, RayFormats, RayRequest, TriangleRay}

/** A prepared ray of the world that is to be traced in an object; hits before `tMax` count. */
final class InstanceVisit(config: PathConfig) extends Bundle {
  val context  = Context(config)
  val isShadow = Bool()
  val instance = InstanceNumber(config.device).get
  val ray      = new TriangleRay(config.numbers)
  val tMax     = new Fixed(new RayFormats(config.numbers).grid)
}

/** What relates distances along an object's ray to those along the world's: docs/numbers.md, section 10. */
final class ObjectScale(numbers: NumberFormats) extends Bundle {

  /** The dominant component of the object's ray. */
  val length = new Normalised(ObjectScale.mantissaBits(numbers), Normalise.exponentBits(numbers.directionBits))

  /** That of the instance's matrix. */
  val shift = UInt(ObjectInstance.shiftBits.W)
}

object ObjectScale {

  /** Of the numbers that are divided, as precise as their quotient. */
  def mantissaBits(numbers: NumberFormats): Int = numbers.mantissaBits.min(numbers.distanceDigits + 1)
}

/** A ray in the axes of an object, from the same origin; no hit that counts is at its limit or beyond. */
final class ObjectRay(config: PathConfig) extends Bundle {
  val request = new RayRequest(config)
  val scale   = new ObjectScale(config.numbers)
}

final class InstanceTransformIO(config: PathConfig) extends Bundle {
  val instances = Input(Vec(config.device.frame.instances, new ObjectInstance(config.device)))

  /** Comes only in the cycle after one with `readyNext`. */
  val visit     = Flipped(Valid(new InstanceVisit(config)))
  val readyNext = Output(Bool())

  val ray = Decoupled(new ObjectRay(config))
}

/** Transforms a ray every three cycles to the axes of an object: a row of the matrix a cycle, with origin and direction.
  * Latency: 13 cycles. Source: docs/numbers.md, section 10.
  */
final class InstanceTransform(config: PathConfig) extends Module {
  private val numbers = config.numbers
  private val grid    = numbers.gridBits

  val io = IO(new InstanceTransformIO(config))

  // Five stages of three cycles. All hold while a ray, which is offered in the first cycle of the last one, is not taken
  private val phase   = RegInit(0.U(2.W))
  private val holds   = RegInit(VecInit.fill(5)(false.B))
  private val moves   = !io.ray.valid || io.ray.ready
  private val isFirst = phase === 0.U
  private val isLast  = phase === 2.U
  io.readyNext := phase === 1.U
  io.ray.valid := holds.last && isFirst
  when(moves) { phase := Mux(isLast, 0.U, phase + 1.U) }
  when(moves && isLast) { holds.zip(io.visit.valid +: holds.init).foreach { case (to, from) => to := from } }
  assert(!io.visit.valid || isLast, "a visit comes when none is taken")

  /** A value of the cycle before; of the stage before. */
  private def delayed[T <: Data](value: T): T = RegEnable(value, moves)
  private def staged[T <: Data](value:  T): T = RegEnable(value, moves && isLast)

  // Stage 0: operands. Their products and sums of three, by row of the matrix, reach into stage 1
  private val visit      = staged(io.visit.bits)
  private val instance   = io.instances(visit.instance)
  private val ray        = visit.ray
  private val one        = (BigInt(1) << numbers.shearFraction).S((grid + 1).W)
  private val slopes     = ray.shear.map(_.integer.pad(grid + 1)) :+ Mux(ray.orientation.negative(2), -one, one)
  private val position   = PermutedFrame.back(ray.origin.map(_.integer), ray.orientation.axis)
  private val fromOrigin = position.axes.zip(instance.origin.axes).map { case (at, origin) => at -& origin }
  private val way        = PermutedFrame.back(slopes, ray.orientation.axis).axes
  private val row        = Mux(isFirst, instance.matrix(0), Mux(isLast, instance.matrix(2), instance.matrix(1)))
  private val factors    = row.axes.map(delayed(_))
  private val sumBits    = ObjectInstance.matrixBits + grid + 3
  private val Seq(steps, direction) = Seq(fromOrigin, way).map { vector =>
    val operands = vector.map(RegEnable(_, moves && isFirst))
    val products = factors.zip(operands).map { case (factor, operand) => delayed(factor * operand) }
    delayed(Rounding.narrow(products.reduce(_ +& _), sumBits))
  }

  // Stage 1: origin and direction in the object, the last row two cycles after the first one
  private val info1     = staged(Info(visit, instance.shift))
  private val halves    = (steps << 1).asSInt >> info1.shift
  private val origin    = delayed(((halves +& 1.S) >> 1).asUInt(numbers.sceneBits - 1, 0).asSInt)
  private val component = delayed(
    Rounding.narrow(Rounding.floor(direction, ObjectInstance.directionDrop(numbers)), numbers.directionBits)
  )

  // Stage 2: the direction's dominant component
  private val info2     = staged(info1)
  private val magnitude = delayed(Normalise.magnitude(component))
  private val largest   = RegInit(0.U(numbers.directionBits.W))
  when(moves && (isLast || magnitude > largest)) { largest := magnitude }
  private val ofObject = Wire(new Bundle {
    val origin = Vec3(new Fixed(new RayFormats(numbers).scene))
    val dir    = Vec3(SInt(numbers.directionBits.W))
  })
  ofObject.origin := Vec3.of(rows(origin).map(Fixed(new RayFormats(numbers).scene, _)))
  ofObject.dir    := Vec3.of(rows(component))
  private val line = Module(new DelayLine(chiselTypeOf(ofObject), 6)).io
  line.moves  := moves
  line.writes := holds(2) && isFirst
  line.in     := ofObject
  line.reads  := holds(3) && isLast

  // Stage 3: the limit, tMax with the errors of distances, times the length, rounded up
  private val info3   = staged(info2)
  private val length  = staged(Normalise(largest, ObjectScale.mantissaBits(numbers)))
  private val slack   = (numbers.distanceDigits - 4).max(0)
  private val tMax    = visit.tMax.integer.asUInt
  private val widened = staged(staged(staged(tMax +& 8.U) +& staged(tMax >> slack)))
  private val product = delayed(widened * delayed(length.mantissa +& 1.U))
  // product · 2^-(mantissaBits - exponent + shearFraction + shift - drop)
  private val drop   = ObjectInstance.directionDrop(numbers)
  private val least  = ObjectScale.mantissaBits(numbers) + numbers.shearFraction - drop - numbers.directionBits
  private val raised = (-least).max(0)
  private val right  = delayed(info3.shift +& (least + raised + numbers.directionBits).U - length.exponent)
  private val limit  =
    Rounding.saturate(
      Rounding.saturate((product << raised).asUInt >> right, numbers.sceneBits + 1) +& 2.U,
      numbers.sceneBits + 1
    )

  // Stage 4: the ray
  private val info4   = staged(info3)
  private val request = io.ray.bits.request
  request.context  := info4.context
  request.isShadow := info4.isShadow
  request.origin   := line.out.origin
  request.dir      := line.out.dir
  request.limits.foreach(_ := DontCare)
  for (visit <- request.visit) {
    visit.valid         := true.B
    visit.bits.instance := info4.instance
    visit.bits.tMax     := delayed(limit)
  }
  io.ray.bits.scale.length := staged(length)
  io.ray.bits.scale.shift  := info4.shift

  /** The rows of three cycles, the last one of this cycle. */
  private def rows[T <: Data](last: T): Seq[T] = {
    val middle = delayed(last)
    Seq(delayed(middle), middle, last)
  }

  /** What goes along with a ray. */
  private final class Info extends Bundle {
    val context  = Context(config)
    val isShadow = Bool()
    val instance = InstanceNumber(config.device).get
    val shift    = UInt(ObjectInstance.shiftBits.W)
  }

  private object Info {
    def apply(visit: InstanceVisit, shift: UInt): Info = {
      val info = Wire(new Info)
      info.context  := visit.context
      info.isShadow := visit.isShadow
      info.instance := visit.instance
      info.shift    := shift
      info
    }
  }
}
