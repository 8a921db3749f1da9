package colonnade.instance

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Mux1H, RegEnable}
import colonnade.common.Context
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{ObjectInstance, Vec3}
import colonnade.numbers.{Fixed, Normalise, Normalised, Rounding}
import colonnade.ray.{PermutedFrame, RayFormats, RayRequest, TriangleRay}

/** A prepared ray of the world that is to be traced in an object; hits before `tMax` count. */
final class InstanceVisit(config: PathConfig) extends Bundle {
  val context  = Context(config)
  val isShadow = Bool()
  val ray      = new TriangleRay(config.numbers)
  val tMax     = new Fixed(new RayFormats(config.numbers).grid)
}

/** What relates distances along an object's ray to those along the world's: docs/numbers.md, section 10. */
final class ObjectScale(numbers: NumberFormats) extends Bundle {

  /** The dominant component of the object's ray. */
  val length = new Normalised(numbers.mantissaBits, Normalise.exponentBits(numbers.directionBits))

  /** That of the instance's matrix. */
  val shift = UInt(ObjectInstance.shiftBits.W)
}

/** A ray in the axes of an object, from the same origin; no hit that counts is at `limit` or beyond, grid steps. */
final class ObjectRay(config: PathConfig) extends Bundle {
  val request = new RayRequest(config)
  val scale   = new ObjectScale(config.numbers)
  val limit   = UInt((config.numbers.sceneBits + 1).W)
}

final class InstanceTransformIO(config: PathConfig) extends Bundle {
  val visit    = Flipped(Decoupled(new InstanceVisit(config)))
  val instance = Input(new ObjectInstance(config.device)) // while a visit is in the unit
  val ray      = Decoupled(new ObjectRay(config))
}

/** Transforms rays to the axes of objects, one after the other, a product a cycle: some 30 cycles a ray.
  * Source: docs/numbers.md, section 10.
  */
final class InstanceTransform(config: PathConfig) extends Module {
  import InstanceTransform._

  private val numbers = config.numbers
  private val grid    = numbers.gridBits

  val io = IO(new InstanceTransformIO(config))

  // The ray in the world's axes
  private val visit    = RegEnable(io.visit.bits, io.visit.fire)
  private val ray      = visit.ray
  private val one      = (BigInt(1) << numbers.shearFraction).S((grid + 1).W)
  private val slopes   = ray.shear.map(_.integer.pad(grid + 1)) :+ Mux(ray.orientation.negative(2), -one, one)
  private val way      = PermutedFrame.back(slopes, ray.orientation.axis)
  private val position = PermutedFrame.back(ray.origin.map(_.integer), ray.orientation.axis)

  // Steps: idle, products, the rest
  private val step   = RegInit(idle.U(log2Ceil(offered + 1).W))
  private val isIdle = step === idle.U
  io.visit.ready := isIdle
  io.ray.valid   := step === offered.U
  when(io.visit.fire || (!isIdle && !io.ray.valid)) { step := step + 1.U }
  when(io.ray.fire) { step := idle.U }
  private def isAt(number: Int): Bool = step === number.U

  // Operands, products, sums of three: of origin and direction, a row of the matrix after the other
  private val fromOrigin = Reg(Vec(3, SInt((grid + 1).W)))
  when(isAt(differences)) {
    fromOrigin.zip(position.axes.zip(io.instance.origin.axes)).foreach { case (to, (at, origin)) => to := at -& origin }
  }
  private def operand(table: Int => SInt): SInt =
    VecInit(Seq.tabulate(products)(table))(step - firstProduct.U)
  private val matrix  = delayed(operand(i => io.instance.matrix(i % 9 / 3).axes(i % 3)))
  private val vector  = delayed(operand(i => if (i < 9) fromOrigin(i % 3) else way.axes(i % 3)))
  private val term    = delayed(matrix * vector)
  private val sumBits = ObjectInstance.matrixBits + grid + 3
  private val sum     = Reg(SInt(sumBits.W))
  private val starts  = (0 until products by 3).map(i => isAt(firstProduct + i + 2)).reduce(_ || _)
  sum := Rounding.narrow(Mux(starts, 0.S, sum) +& term, sumBits)
  private val halved = delayed((sum << 1).asSInt >> io.instance.shift)
  private val origin = Reg(Vec(3, SInt(numbers.sceneBits.W)))
  private val dir    = Reg(Vec(3, SInt(numbers.directionBits.W)))
  for (row <- 0 until 3) {
    when(isAt(firstProduct + 3 * row + 6)) {
      origin(row) := ((halved +& 1.S) >> 1).asUInt(numbers.sceneBits - 1, 0).asSInt
    }
    when(isAt(firstProduct + 9 + 3 * row + 5)) {
      dir(row) := Rounding.narrow(Rounding.floor(sum, ObjectInstance.directionDrop(numbers)), numbers.directionBits)
    }
  }

  // The direction's dominant component, ties to the lowest axis
  private val magnitudes = dir.map(component => delayed(Normalise.magnitude(component)))
  private val isZ        = magnitudes(2) > magnitudes(1) && magnitudes(2) > magnitudes(0)
  private val isY        = magnitudes(1) > magnitudes(0) && !isZ
  private val largest    = delayed(Mux1H(Seq(!isY && !isZ, isY, isZ), magnitudes))
  private val length     = delayed(Normalise(largest, numbers.mantissaBits))

  // The limit: tMax with the errors of distances, times the length, rounded up
  private val slack   = (numbers.mantissaBits.min(numbers.distanceDigits) - 4).max(0)
  private val tMax    = visit.tMax.integer.asUInt
  private val widened = delayed(delayed(tMax +& 8.U) +& delayed(tMax >> slack))
  private val factor  = delayed(length.mantissa +& 1.U)
  private val product = delayed(widened * factor)
  // product · 2^-(mantissaBits - exponent + shearFraction + shift - drop)
  private val drop    = ObjectInstance.directionDrop(numbers)
  private val least   = numbers.mantissaBits + numbers.shearFraction - drop - numbers.directionBits
  private val raised  = (-least).max(0)
  private val right   = delayed(io.instance.shift +& (least + raised + numbers.directionBits).U - length.exponent)
  private val wide    = (product << raised).asUInt
  private val floored = delayed(Rounding.saturate(wide >> right, numbers.sceneBits + 1))

  io.ray.bits.request.context  := visit.context
  io.ray.bits.request.isShadow := visit.isShadow
  io.ray.bits.request.origin   := Vec3.of(origin.map(Fixed(new RayFormats(numbers).scene, _)))
  io.ray.bits.request.dir      := Vec3.of(dir.toSeq)
  io.ray.bits.request.limits.foreach(_ := DontCare)
  io.ray.bits.scale.length := length
  io.ray.bits.scale.shift  := io.instance.shift
  io.ray.bits.limit        := delayed(Rounding.saturate(floored +& 2.U, numbers.sceneBits + 1))

  /** The value of the cycle before, as wide. */
  private def delayed[T <: Data](value: T): T = {
    val register = Reg(chiselTypeOf(value))
    register := value
    register
  }
}

private object InstanceTransform {
  val products: Int = 18

  /** The steps of a visit: one after the last sum come magnitudes, largest, length, factor, product, floored, limit. */
  val idle:         Int = 0
  val differences:  Int = 1
  val firstProduct: Int = 2
  val offered:      Int = firstProduct + products + 3 + 7
}
