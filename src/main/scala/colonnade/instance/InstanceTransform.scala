package colonnade.instance

import chisel3._
import chisel3.util.{Cat, Decoupled, RegEnable, Valid}
import colonnade.common.Context
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

  /** The shift of the instance's matrix. */
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

/** Transforms a ray every three cycles to the axes of an object: a row of the matrix a cycle, with origin and
  * direction. Latency: 13 cycles. Source: docs/numbers.md, section 10.
  */
final class InstanceTransform(config: PathConfig) extends Module {
  private val numbers = config.numbers

  val io = IO(new InstanceTransformIO(config))

  // Five stages of three cycles. All hold while a ray, which is offered in the first cycle of the last one, is not
  // taken
  private val phase   = RegInit(0.U(2.W))
  private val holds   = RegInit(VecInit.fill(5)(false.B))
  private val moves   = !io.ray.valid || io.ray.ready
  private val isFirst = phase === 0.U
  private val isNext  = phase === 1.U
  private val isLast  = phase === 2.U
  io.readyNext := isNext
  io.ray.valid := holds.last && isFirst
  when(moves) { phase := Mux(isLast, 0.U, phase + 1.U) }
  when(moves && isLast) { holds.zip(io.visit.valid +: holds.init).foreach { case (to, from) => to := from } }
  assert(!io.visit.valid || isLast, "a visit comes when none is taken")

  /** A value of the cycle before; of the stage before; of the second cycle of the stage before. */
  private def delayed[T <: Data](value: T): T = RegEnable(value, moves)
  private def staged[T <: Data](value:  T): T = RegEnable(value, moves && isLast)
  private def early[T <: Data](value:   T): T = RegEnable(value, moves && isNext)

  // The operands, in the ray's own frame, as a visit comes. Products and sums of three, by row of the matrix, reach
  // into stage 1. Along the dominant axis the direction is 1 or -1
  private val visit      = io.visit.bits
  private val info0      = staged(VisitInfo(visit))
  private val axis0      = staged(visit.ray.orientation.axis)
  private val axis       = Mux(isLast, visit.ray.orientation.axis, axis0)
  private val instance   = io.instances(Mux(isLast, visit.instance, info0.instance))
  private val shift0     = staged(instance.shift)
  private val row        = Mux(isLast, instance.matrix(0), Mux(isFirst, instance.matrix(1), instance.matrix(2)))
  private val factors    = PermutedFrame(row, axis).map(delayed(_))
  private val fromOrigin = visit.ray.origin.zip(PermutedFrame(instance.origin, axis)).map { case (at, origin) =>
    staged(at.integer -& origin)
  }
  private val slopes     = visit.ray.shear.map(shear => staged(shear.integer))
  private val isNegative = staged(visit.ray.orientation.negative(2))
  private val along      = delayed(Mux(isNegative, 0.S -& factors(2), factors(2))) << numbers.shearFraction
  private val sumBits    = ObjectInstance.matrixBits + numbers.gridBits + 3
  private def products(vector: Seq[SInt]): Seq[SInt] =
    factors.zip(vector).map { case (factor, operand) => delayed(factor * operand) }
  private val Seq(steps, direction) = Seq(products(fromOrigin), products(slopes.toSeq) :+ along).map { terms =>
    delayed(Rounding.narrow(terms.reduce(_ +& _), sumBits))
  }

  // Stage 1: a row of origin and direction in the object each cycle
  private val shift1    = staged(shift0)
  private val halves    = (steps << 1).asSInt >> Mux(isLast, shift0, shift1)
  private val origin    = delayed(((halves +& 1.S) >> 1).asUInt(numbers.sceneBits - 1, 0).asSInt)
  private val component = delayed(
    Rounding.narrow(Rounding.floor(direction, ObjectInstance.directionDrop(numbers)), numbers.directionBits)
  )

  // They wait for stage 4 in memories of a word for each stage on the way. An offered ray is read again
  private val word     = RegInit(0.U(2.W))
  private val nextWord = Mux(word === 2.U, 0.U, word + 1.U)
  when(moves && isLast) { word := nextWord }
  private def waiting[T <: Data](value: T, cycle: Bool): T = {
    val memory = SyncReadMem(3, UInt(value.getWidth.W))
    when(moves && holds(1) && cycle) { memory.write(word, value.asUInt) }
    memory.read(Mux(isLast, nextWord, word), Mux(isLast, holds(3), !moves)).asTypeOf(value)
  }
  private val cycles     = Seq(isFirst, isNext, isLast)
  private val info4      = waiting(staged(info0), isFirst)
  private val origins    = cycles.map(waiting(origin, _))
  private val components = cycles.map(waiting(component, _))

  // Stage 2: the direction's dominant component, up to the second cycle
  private val magnitude = delayed(Normalise.magnitude(component))
  private val largest   = RegInit(0.U(numbers.directionBits.W))
  when(moves && (isNext || magnitude > largest)) { largest := magnitude }
  private val length = early(Normalise(largest, ObjectScale.mantissaBits(numbers)))

  // The limit, tMax with the errors of distances, times the length, rounded up: a third of the mantissa a cycle
  private val slack     = (numbers.distanceDigits - 4).max(0)
  private val tMax      = staged(staged(staged(visit.tMax.integer.asUInt)))
  private val widened   = early(tMax +& 8.U +& (tMax >> slack))
  private val digitBits = (ObjectScale.mantissaBits(numbers) + 2) / 3
  private val digits    = length.mantissa.pad(3 * digitBits)
  private val digit     =
    Mux(isLast, digits(digitBits - 1, 0), Mux(isFirst, digits(2 * digitBits - 1, digitBits), digits >> (2 * digitBits)))
  private val high = Reg(UInt((widened.getWidth + digitBits).W))
  private val low  = Reg(UInt((2 * digitBits).W))
  private val sum  = Rounding.narrow(widened * digit +& Mux(isLast, widened, high >> digitBits), high.getWidth)
  when(moves) {
    high := sum
    low  := Cat(high(digitBits - 1, 0), low) >> digitBits
  }
  private val product = high ## low
  // product · 2^-(mantissaBits - exponent + shearFraction + shift - drop)
  private val drop   = ObjectInstance.directionDrop(numbers)
  private val least  = ObjectScale.mantissaBits(numbers) + numbers.shearFraction - drop - numbers.directionBits
  private val raised = (-least).max(0)
  private val shift3 = staged(staged(shift1))
  private val right  = delayed(shift3 +& (least + raised + numbers.directionBits).U - length.exponent)
  private val limit  =
    Rounding.saturate(
      Rounding.saturate((product << raised).asUInt >> right, numbers.sceneBits + 1) +& 2.U,
      numbers.sceneBits + 1
    )

  // Stage 4: the ray
  private val request = io.ray.bits.request
  request.context  := info4.context
  request.isShadow := info4.isShadow
  request.origin   := Vec3.of(origins.map(Fixed(new RayFormats(numbers).scene, _)))
  request.dir      := Vec3.of(components)
  request.limits.foreach(_ := DontCare)
  for (visit <- request.visit) {
    visit.valid         := true.B
    visit.bits.instance := info4.instance
    visit.bits.tMax     := delayed(limit)
  }
  io.ray.bits.scale.length := early(length)
  io.ray.bits.scale.shift  := staged(shift3)

  /** What goes along with a ray. */
  private final class VisitInfo extends Bundle {
    val context  = Context(config)
    val isShadow = Bool()
    val instance = InstanceNumber(config.device).get
  }

  private object VisitInfo {
    def apply(visit: InstanceVisit): VisitInfo = {
      val info = Wire(new VisitInfo)
      info.context  := visit.context
      info.isShadow := visit.isShadow
      info.instance := visit.instance
      info
    }
  }
}
