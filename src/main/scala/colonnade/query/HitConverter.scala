package colonnade.query

import chisel3._
import chisel3.util.{Cat, Decoupled, RegEnable}
import colonnade.common.DelayLine
import colonnade.config.PathConfig
import colonnade.formats.{HitRecord, RayPlacement}
import colonnade.numbers.{Float32, Normalise, PipelinedDivider, Rounding}
import colonnade.traversal.TriangleHit

/** What is known of a ray that has been traced. */
final class TracedHit(config: PathConfig) extends Bundle {
  val scale   = new RayScale
  val hasHit  = Bool()
  val tEntry  = UInt(config.numbers.entryBits.W)
  val hit     = new TriangleHit(config)
  val isClear = Bool()

  /** Its u and v are asked for. */
  val hasWeights = Bool()
}

final class HitConverterIO(config: PathConfig) extends Bundle {
  val placement = Input(new RayPlacement) // constant while a hit is in the unit
  val hits      = Flipped(Decoupled(new TracedHit(config)))
  val records   = Decoupled(new HitRecord)
  val isIdle    = Output(Bool())
}

/** Converts hits to an application's numbers: docs/numbers.md, section 9, rule 6. In order; a hit takes three cycles,
  * for the quotients t, u and v, a range one. All stages move together, while no record waits.
  */
final class HitConverter(config: PathConfig) extends Module {
  import HitConverter._

  val io = IO(new HitConverterIO(config))

  private val numbers   = config.numbers
  private val half      = Float32.mantissaBits
  private val width     = 2 * half
  private val divisions = PipelinedDivider.stages(digits)

  private val record = Reg(new HitRecord)
  private val offers = RegInit(false.B)
  private val moves  = !offers || io.records.ready
  io.records.valid := offers
  io.records.bits  := record

  // Stage 0: a hit, with its t in grid steps
  private val holds  = RegInit(false.B)
  private val which  = RegInit(0.U(2.W)) // t, u, v
  private val traced = RegEnable(io.hits.bits, io.hits.fire)
  private val steps  = RegEnable(
    (Rounding.floor(io.hits.bits.tEntry, -numbers.gridFraction) +& io.hits.bits.hit.t.integer.asUInt).pad(width),
    io.hits.fire
  )
  private val isLast = !(traced.hasWeights && traced.hasHit) || which === 2.U
  io.hits.ready := !holds || (moves && isLast)
  when(moves && holds) { which := Mux(isLast, 0.U, which + 1.U) }
  when(io.hits.ready) { holds := io.hits.valid }

  // Stage 1: the operands; the product with the scale is the denominator of t
  private val weights     = traced.hit.weights.map(_.natural.pad(width))
  private val isT         = which === 0.U
  private val numerator   = load(Mux(isT, steps, Mux(which === 1.U, weights(1), weights(2))))
  private val product     = load(traced.scale.dominant.mantissa * io.placement.mantissa)
  private val sum         = load(weights.reduce(_ + _))
  private val denominator = Mux(load(isT), product, sum)
  private val exponent    = load(Mux(
    isT,
    (width + Float32.half).S(RayConverter.exponentBits.W) - traced.scale.dominant.biased.zext -
      RayConverter.gridExponent(numbers, io.placement.exponent),
    0.S
  ))
  private val entering = Wire(new Passing)
  entering.exponent := DontCare
  entering.isZero   := DontCare
  entering.which    := which
  entering.isLast   := isLast
  entering.hasHit   := traced.hasHit
  entering.tFar     := traced.scale.tFar
  entering.id       := Mux(
    traced.hasHit,
    Cat(traced.hit.backSide, traced.isClear, traced.hit.id.pad(30)),
    Mux(traced.scale.isOutOfRange, HitRecord.outOfRange.U, HitRecord.miss.U)
  )

  // Stage 2: mantissas, and the biased exponent of a quotient below 1
  private val Seq(upper, lower) = Seq(numerator, denominator).map(Normalise(_, width)).map(load(_))
  private val passing           = Wire(new Passing)
  passing          := load(load(entering))
  passing.isZero   := upper.exponent === 0.U
  passing.exponent := load(exponent) + Float32.half.S + (upper.exponent.zext - lower.exponent.zext)

  // The quotient, and what goes along with it
  private val isValid = Seq.iterate(holds, 3 + divisions)(flag => RegEnable(flag, false.B, moves))
  private val divider = Module(new PipelinedDivider(width, digits, lanes = 1, hasRest = true)).io
  private val along   = Module(new DelayLine(new Passing, divisions)).io
  divider.loads.foreach(_ := moves)
  divider.numerators.head := upper.mantissa
  divider.denominator     := Cat(true.B, lower.mantissa(width - 2, 0))
  along.moves             := moves
  along.writes            := isValid(2)
  along.in                := passing
  along.reads             := isValid(1 + divisions)

  // The nearest float; a quotient of one digit more is 1 or above
  private val isAbove     = divider.quotients.head(digits)
  private val digitsBelow = divider.quotients.head(digits - 1, 0)
  private val digitsOf    = Mux(isAbove, divider.quotients.head(digits, 1), digitsBelow)
  private val isInexact   = divider.rests.get.head || (isAbove && divider.quotients.head(0))
  private val rounded     = digitsOf(half, 1) +& (digitsOf(0) && (isInexact || digitsOf(1)))
  private val leaving     = along.out
  private val biased      = leaving.exponent + (isAbove +& rounded(half)).zext
  private val float       = Wire(new Float32)
  float.isNegative := false.B
  float.biased     := Mux(biased >= 255.S, 255.U, biased.asUInt(7, 0))
  float.fraction   := Mux(biased >= 255.S, 0.U, rounded(half - 2, 0))
  when(leaving.isZero || biased <= 0.S) { float := Float32.zero }

  // The record, word by word
  private val isDone = isValid(2 + divisions)
  when(moves) {
    offers := isDone && leaving.isLast
    when(isDone && leaving.which === 0.U) {
      record.t  := Mux(leaving.hasHit, float, leaving.tFar)
      record.id := leaving.id
      record.u  := Float32.zero
      record.v  := Float32.zero
    }
    when(isDone && leaving.which === 1.U) { record.u := float }
    when(isDone && leaving.which === 2.U) { record.v := float }
  }
  io.isIdle := !isValid.reduce(_ || _) && !offers

  private def load[T <: Data](value: T): T = RegEnable(value, moves)
}

object HitConverter {

  /** Fraction digits of a quotient: a float's and one for rounding, of a quotient of a half or more. */
  private val digits = Float32.mantissaBits + 1
}

/** What goes along with a quotient. */
final private class Passing extends Bundle {
  val exponent = SInt(RayConverter.exponentBits.W)
  val isZero   = Bool()
  val which    = UInt(2.W)
  val isLast   = Bool()
  val hasHit   = Bool()
  val tFar     = new Float32
  val id       = UInt(32.W)
}
