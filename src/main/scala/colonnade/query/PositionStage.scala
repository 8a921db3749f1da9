package colonnade.query

import chisel3._
import chisel3.util.{Cat, Decoupled, RegEnable}
import colonnade.config.PathConfig
import colonnade.formats.RayPlacement
import colonnade.numbers.{Fixed, Float32, Rounding}
import colonnade.ray.RayRequest

/** A ray on the grid, with limits that are to be converted: those of `converted` have their filter alone. */
final class PlacedRay(config: PathConfig) extends Bundle {
  val converted = new ConvertedRay(config)
  val limits    = new FloatLimits
}

final class PositionStageIO(config: PathConfig) extends Bundle {
  val placement = Input(new RayPlacement)
  val rays      = Flipped(Decoupled(new BatchRay(config)))
  val placed    = Decoupled(new PlacedRay(config))
}

/** Converts a ray's origin and direction: docs/numbers.md, section 9, rules 1 to 3, and the product of rule 4.
  *
  * One component a cycle passes a shifter, a sum with `base` and a multiplier, which a last cycle uses for the product. A
  * ray takes [[PositionStage.steps]] cycles; the next one is accepted when the result is taken.
  */
final class PositionStage(config: PathConfig) extends Module {
  import PositionStage._

  val io = IO(new PositionStageIO(config))

  private val numbers       = config.numbers
  private val directionBits = numbers.directionBits
  private val half          = Float32.mantissaBits

  // A ray, and its step: the component that the shifter has
  private val step  = RegInit((steps - 1).U(4.W))
  private val empty = RegInit(true.B)
  private val ray   = Reg(new BatchRay(config))
  private val ends  = step === (steps - 1).U
  io.rays.ready   := empty || io.placed.fire
  io.placed.valid := ends && !empty
  when(!ends) { step := step + 1.U }
  when(io.placed.fire) { empty := true.B }
  when(io.rays.fire) {
    ray   := io.rays.bits
    step  := 0.U
    empty := false.B
  }
  private val record  = ray.record
  private val isFirst = step === 0.U

  // The largest component of the direction; rays that are none
  private val largest  = record.dir.reduce((a, b) => Mux(b.magnitude > a.magnitude, b, a))
  private val dominant = RegEnable(largest, isFirst)
  private val isFinite = (record.origin ++ record.dir).map(_.isFinite).reduce(_ && _)
  private val isEmpty  = record.tNear.isNan || record.tFar.isNan || !record.tNear.isAtMost(record.tFar) ||
    (record.tFar.isNegative && !record.tFar.isZero)
  private val isRefused = RegEnable(!isFinite || isEmpty || largest.isZero, isFirst)

  // Shift a component: the mantissa is at the top of a fixed-point number, with a digit behind it for rounding
  private val components   = VecInit(record.origin ++ record.dir)
  private val component    = components(Mux(step > 5.U, 5.U, step)(2, 0))
  private val isDirection  = step >= 3.U
  private val gridExponent = RayConverter.gridExponent(numbers, io.placement.exponent)
  private val toOrigin     = (fixedBits + Float32.half - RayPlacement.fractionBits).S(RayConverter.exponentBits.W) -
    component.biased.zext - gridExponent
  private val toDirection =
    (fixedBits - directionBits + 2).S(RayConverter.exponentBits.W) + (dominant.biased.zext - component.biased.zext)
  private val amount             = Mux(isDirection, toDirection, toOrigin)
  private val mantissa           = Cat(component.mantissa, 0.U((fixedBits - half + 1).W))
  private val (shifted, inexact) = Rounding.floorInexact(mantissa, RayConverter.shift(amount, 127))
  private val isLarge            = held(amount < 0.S && !component.isZero)
  private val floor              = held(shifted >> 1)
  private val roundsUp           = held(shifted(0) && (inexact || shifted(1)))
  private val isNegative         = held(component.isNegative)

  // Round it: minus a number that is rounded up is its complement, without the carry
  private val signed  = floor.zext
  private val rounded = held(Mux(isNegative, ~signed, signed) + (roundsUp =/= isNegative).asUInt.zext)
  private val isHuge  = held(isLarge)

  // Positions: minus the base, times the scale; the product of two mantissas is the last one
  private val operandBits = numbers.gridBits + 6
  private val bases       = VecInit(io.placement.base.axes)
  private val base        = Mux(ray.isLocal, 0.S, bases((step - 2.U)(1, 0))) // read in steps 2 to 4
  private val difference  = rounded -& base
  private val isDistant   = held(isHuge || Rounding.saturate(difference, operandBits) =/= difference)
  private val operand     = held(Rounding.narrow(difference, operandBits))
  private val isProduct   = step === 6.U
  private val product     = held(
    Mux(isProduct, dominant.mantissa.zext.pad(operandBits), operand) * io.placement.mantissa.zext
  )
  private val wasDistant = held(isDistant)
  private val position   = Rounding.nearestEven(product, half + RayPlacement.fractionBits)
  private val edges      = position >> (numbers.gridBits + 1) // 16 of the box
  private val isInRange  = edges === 0.S || (edges === -1.S && position(numbers.gridBits, 0).orR)

  // Results
  private val request  = Reg(new RayRequest(config))
  private val scale    = Reg(UInt((2 * half).W))
  private val isTooFar = Reg(Bool())
  for (axis <- 0 until 3) {
    when(step === (4 + axis).U) {
      request.origin.axes(axis) := Fixed(request.origin.axes(axis).format, Rounding.narrow(position, numbers.sceneBits))
    }
    when(step === (5 + axis).U) { request.dir.axes(axis) := Rounding.narrow(rounded, directionBits) }
  }
  when(step >= 4.U && step <= 6.U) { isTooFar := (isTooFar && step =/= 4.U) || wasDistant || !isInRange }
  when(step === 7.U) { scale := product.asUInt(2 * half - 1, 0) }

  private val converted = io.placed.bits.converted
  converted.request          := request
  converted.request.context  := ray.context
  converted.request.isShadow := ray.isOccluded
  for (direction <- converted.request.dir.axes) when(isRefused || isTooFar) { direction := 0.S }
  for (limits <- converted.request.limits) {
    limits        := DontCare
    limits.filter := ray.filter
  }
  converted.scale.dominant       := dominant
  converted.scale.tFar           := record.tFar
  converted.scale.isOutOfRange   := isTooFar && !isRefused
  converted.isRefused            := isRefused
  io.placed.bits.limits.tNear    := record.tNear
  io.placed.bits.limits.tFar     := record.tFar
  io.placed.bits.limits.product  := scale
  io.placed.bits.limits.dominant := dominant.biased

  /** Holds while a result is offered. */
  private def held[T <: Data](value: T): T = RegEnable(value, !ends)
}

object PositionStage {

  /** Cycles a ray. */
  val steps: Int = 9

  /** Bits of a coordinate in fractions of a grid step. */
  private val fixedBits = 62
}
