package colonnade.query

import chisel3._
import chisel3.util.{Cat, Decoupled, Mux1H, RegEnable}
import colonnade.config.PathConfig
import colonnade.formats.RayPlacement
import colonnade.numbers.{Fixed, Float32, Rounding}
import colonnade.ray.RayRequest

/** A ray on the grid, with limits to be converted; in `converted` they have only their filter. */
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
  * One component a cycle passes a shifter, a sum with `base` and a multiplier, which a last cycle uses for the product.
  * Throughput: a ray every [[PositionStage.interval]] cycles; latency: [[PositionStage.steps]] cycles. All steps stand
  * still while a result is not taken.
  */
final class PositionStage(config: PathConfig) extends Module {
  import PositionStage._

  val io = IO(new PositionStageIO(config))

  private val numbers       = config.numbers
  private val directionBits = numbers.directionBits
  private val half          = Float32.mantissaBits

  // The steps that have a ray: a ray comes when the one before it is through with its record
  private val arrives = io.rays.fire
  private val step    = RegInit(VecInit.fill(steps)(false.B))
  private val moves   = !step.last || io.placed.ready
  private val ray     = RegEnable(io.rays.bits, arrives)
  io.rays.ready   := moves && !step.take(interval - 1).reduce(_ || _)
  io.placed.valid := step.last
  when(moves) { step.zip(arrives +: step).foreach { case (to, from) => to := from } }
  private val record = ray.record

  // The largest component of the direction; rays that are none
  private val largest  = record.dir.reduce((a, b) => Mux(b.magnitude > a.magnitude, b, a))
  private val dominant = held(largest, 0)
  private val isFinite = (record.origin ++ record.dir).map(_.isFinite).reduce(_ && _)
  private val isEmpty  = record.tNear.isNan || record.tFar.isNan || !record.tNear.isAtMost(record.tFar) ||
    (record.tFar.isNegative && !record.tFar.isZero)
  private val isRefused = held(!isFinite || isEmpty || largest.isZero, 0)

  // Shift a component: the mantissa is at the top of a fixed-point number, with a digit behind it for rounding
  private val component    = Mux1H(step.take(interval), record.origin ++ record.dir)
  private val isDirection  = step.slice(3, interval).reduce(_ || _)
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
  private val base        = Mux(ray.isLocal, 0.S, Mux1H(step.slice(2, 5), io.placement.base.axes))
  private val difference  = rounded -& base
  private val isDistant   = held(isHuge || Rounding.saturate(difference, operandBits) =/= difference)
  private val operand     = held(Rounding.narrow(difference, operandBits))
  private val product     = held(
    Mux(step(6), dominant.mantissa.zext.pad(operandBits), operand) * io.placement.mantissa.zext
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
    when(step(4 + axis)) {
      request.origin.axes(axis) := Fixed(request.origin.axes(axis).format, Rounding.narrow(position, numbers.sceneBits))
    }
    when(step(5 + axis)) { request.dir.axes(axis) := Rounding.narrow(rounded, directionBits) }
  }
  when(step.slice(4, 7).reduce(_ || _)) { isTooFar := (isTooFar && !step(4)) || wasDistant || !isInRange }
  when(step(7)) { scale := product.asUInt(2 * half - 1, 0) }

  // The rest of the ray, before the next one comes
  private val last       = held(ray, 5)
  private val length     = held(dominant, 6)
  private val wasRefused = held(isRefused, 6)
  private val converted  = io.placed.bits.converted
  converted.request          := request
  converted.request.context  := last.context
  converted.request.isShadow := last.isOccluded
  for (direction <- converted.request.dir.axes) when(wasRefused || isTooFar) { direction := 0.S }
  for (limits <- converted.request.limits) {
    limits        := DontCare
    limits.filter := last.filter
  }
  converted.scale.dominant       := length
  converted.scale.tFar           := last.record.tFar
  converted.scale.isOutOfRange   := isTooFar && !wasRefused
  converted.isRefused            := wasRefused
  io.placed.bits.limits.tNear    := last.record.tNear
  io.placed.bits.limits.tFar     := last.record.tFar
  io.placed.bits.limits.product  := scale
  io.placed.bits.limits.dominant := length.biased

  private def held[T <: Data](value: T): T = RegEnable(value, moves)

  /** The value of a ray in a step, until the next ray's. */
  private def held[T <: Data](value: T, in: Int): T = RegEnable(value, moves && step(in))
}

object PositionStage {

  /** Cycles of a ray, and those between rays: a component each. */
  val steps:    Int = 9
  val interval: Int = 6

  /** Bits of a coordinate in fractions of a grid step. */
  private val fixedBits = 62
}
