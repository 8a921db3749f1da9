package colonnade.instance

import chisel3._
import chisel3.util.{Decoupled, RegEnable}
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

  val visit = Flipped(Decoupled(new InstanceVisit(config)))
  val ray   = Decoupled(new ObjectRay(config))
}

/** Transforms a ray a cycle to the axes of an object: a product or a sum of three a stage. All stages stall together
  * while the offered ray is not taken. Latency: ten cycles. Source: docs/numbers.md, section 10.
  */
final class InstanceTransform(config: PathConfig) extends Module {
  import InstanceTransform._

  private val numbers  = config.numbers
  private val mantissa = ObjectScale.mantissaBits(numbers)

  val io = IO(new InstanceTransformIO(config))

  // Control: a stage loads if the one before it holds a ray
  private val holds   = RegInit(VecInit.fill(stages)(false.B))
  private val moves   = !holds.last || io.ray.ready
  private val arrives = io.visit.valid +: holds.init
  private val shifts  = moves && holds.asUInt.orR
  when(moves) { holds.zip(arrives).foreach { case (to, from) => to := from } }
  io.visit.ready := moves
  io.ray.valid   := holds.last

  /** A value as the register of a stage; the register of stage `from` as that of stage `to`. */
  private def load[T <: Data](value: T, stage: Int): T          = RegEnable(value, moves && arrives(stage))
  private def hold[T <: Data](value: T, from:  Int, to: Int): T = (from + 1 to to).foldLeft(value)(load(_, _))

  /** The same in a memory. */
  private def delayed[T <: Data](value: T, from: Int, to: Int): T = {
    val line = Module(new DelayLine(UInt(value.getWidth.W), to - from)).io
    line.moves  := shifts
    line.writes := holds(from)
    line.in     := value.asUInt
    line.reads  := holds(to - 1)
    line.out.asTypeOf(value)
  }

  // The operands, in the ray's own frame
  private val visit      = io.visit.bits
  private val axis       = visit.ray.orientation.axis
  private val instance   = io.instances(visit.instance)
  private val info       = load(VisitInfo(visit), operands)
  private val shift      = load(instance.shift, operands)
  private val rows       = instance.matrix.map(row => PermutedFrame(row, axis).map(load(_, operands)))
  private val fromOrigin = visit.ray.origin.zip(PermutedFrame(instance.origin, axis)).map { case (at, origin) =>
    load(at.integer -& origin, operands)
  }
  private val slopes     = visit.ray.shear.map(shear => load(shear.integer, operands))
  private val isNegative = load(visit.ray.orientation.negative(2), operands)

  // Origin and direction in the object, by row of the matrix. Along the dominant axis the direction is 1 or -1
  private val sumBits                     = ObjectInstance.matrixBits + numbers.gridBits + 3
  private def sum(terms: Seq[SInt]): SInt = load(Rounding.narrow(terms.reduce(_ +& _), sumBits), sums)
  private val shift2                      = hold(shift, operands, sums)
  private val origins                     = rows.map { row =>
    val steps  = sum(row.zip(fromOrigin).map { case (factor, operand) => load(factor * operand, products) })
    val halves = (steps << 1).asSInt >> shift2
    load(((halves +& 1.S) >> 1).asUInt(numbers.sceneBits - 1, 0).asSInt, rounded)
  }
  private val components = rows.map { row =>
    val along     = load(Mux(isNegative, 0.S -& row(2), row(2)), products) << numbers.shearFraction
    val direction = sum(row.zip(slopes).map { case (factor, slope) => load(factor * slope, products) } :+ along)
    load(
      Rounding.narrow(Rounding.floor(direction, ObjectInstance.directionDrop(numbers)), numbers.directionBits),
      rounded
    )
  }

  // The direction's dominant component
  private val sizes   = components.map(component => load(Normalise.magnitude(component), magnitudes))
  private val largest = {
    val Seq(x, y, z) = sizes
    load(Mux(z > y && z > x, z, Mux(y > x, y, x)), dominant)
  }
  private val length = load(Normalise(largest, mantissa), normalised)

  // The limit, tMax with the errors of distances, times the length and 2^-mantissa, rounded up
  private val slack   = (numbers.distanceDigits - 4).max(0)
  private val tMax    = hold(load(visit.tMax.integer.asUInt, operands), operands, dominant)
  private val widened = load(tMax +& 8.U +& (tMax >> slack), normalised)
  private val product = load(widened * length.mantissa, scaled) +& hold(widened, normalised, scaled)
  // product · 2^-(mantissaBits - exponent + shearFraction + shift - drop)
  private val drop   = ObjectInstance.directionDrop(numbers)
  private val least  = mantissa + numbers.shearFraction - drop - numbers.directionBits
  private val raised = (-least).max(0)
  private val shift6 = hold(shift2, sums, normalised)
  private val right  = hold(
    load(shift6 +& (least + raised + numbers.directionBits).U - length.exponent, scaled),
    scaled,
    summed
  )
  private val limit =
    Rounding.saturate(
      Rounding.saturate((load(product, summed) << raised).asUInt >> right, numbers.sceneBits + 1) +& 2.U,
      numbers.sceneBits + 1
    )

  // The ray
  private val request = io.ray.bits.request
  private val along   = delayed(info, operands, limited)
  private val from    = origins.map(delayed(_, rounded, limited))
  request.context  := along.context
  request.isShadow := along.isShadow
  request.origin   := Vec3.of(from.map(Fixed(new RayFormats(numbers).scene, _)))
  request.dir      := Vec3.of(components.map(delayed(_, rounded, limited)))
  request.limits.foreach(_ := DontCare)
  for (visit <- request.visit) {
    visit.valid         := true.B
    visit.bits.instance := along.instance
    visit.bits.tMax     := load(limit, limited)
  }
  io.ray.bits.scale.length := hold(length, normalised, limited)
  io.ray.bits.scale.shift  := hold(shift6, normalised, limited)

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

/** The stages by number, named after what their registers hold. */
private object InstanceTransform {
  val Seq(operands, products, sums, rounded, magnitudes, dominant, normalised, scaled, summed, limited) = 0 to 9

  val stages: Int = limited + 1
}
