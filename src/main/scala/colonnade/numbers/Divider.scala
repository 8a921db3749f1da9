package colonnade.numbers

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled, RegEnable}

/** The operands of a division: two mantissas.
  *
  * @param numerator   its top bit is set, or it is zero
  * @param denominator its top bit is set
  */
final class Division(mantissaBits: Int) extends Bundle {
  val numerator   = UInt(mantissaBits.W)
  val denominator = UInt(mantissaBits.W)
}

final class DividerIO(mantissaBits: Int, digits: Int) extends Bundle {
  val division = Flipped(Decoupled(new Division(mantissaBits)))
  val quotient = Decoupled(UInt((digits + 1).W)) // ⌊numerator · 2^digits / denominator⌋
}

/** Divides mantissas by restoring digit recurrence in radix 4. Three parallel subtractors try one, two and three times
  * the denominator; the largest multiple that fits gives two quotient bits.
  *
  * Latency ⌈(digits + 1) / (2 · digitsPerCycle)⌉ + 1 cycles, one division at a time. The next division can enter in the
  * cycle in which a quotient leaves. The quotient is meaningless if the denominator's top bit is clear.
  *
  * @param digits         fraction bits of the quotient
  * @param digitsPerCycle radix-4 digits computed in series in one cycle
  */
final class Divider(mantissaBits: Int, digits: Int, digitsPerCycle: Int = 1) extends Module {
  require(mantissaBits >= 1, s"a divider of $mantissaBits-bit mantissas; they must have at least 1 bit")
  require(digits >= 0, s"a divider for $digits digits; it must be for at least 0")

  val io = IO(new DividerIO(mantissaBits, digits))

  private val steps        = Divider.steps(digits, digitsPerCycle)
  private val quotientBits = 2 * steps * digitsPerCycle
  private val spareBits    = quotientBits - (digits + 1) // the last step computes and drops them

  private val busy      = RegInit(false.B)
  private val stepsLeft = Reg(UInt(log2Ceil(steps + 1).W))
  private val quotient  = Reg(UInt(quotientBits.W))
  private val remainder = Reg(UInt((mantissaBits + 2).W)) // always less than four times the denominator
  private val once      = Reg(UInt(mantissaBits.W))
  private val thrice    = Reg(UInt((mantissaBits + 2).W))

  private val finished = busy && stepsLeft === 0.U

  // Try the three multiples
  private def step(remainder: UInt): (UInt, UInt) = {
    val multiples     = Seq(once.pad(mantissaBits + 2), Cat(0.U(1.W), once, 0.U(1.W)), thrice)
    val (fits, tried) = multiples.map(DigitRecurrence.subtract(remainder, _)).unzip
    val digit         = Cat(fits(1), Mux(fits(1), fits(2), fits(0)))
    val reduced       =
      Mux(fits(1), Mux(fits(2), tried(2), tried(1)), Mux(fits(0), tried(0), remainder))(mantissaBits - 1, 0)
    (Cat(reduced, 0.U(2.W)), digit)
  }
  private val (reduced, found) = (1 to digitsPerCycle).foldLeft((remainder, quotient)) { case ((left, found), _) =>
    val (reduced, digit) = step(left)
    (reduced, Cat(found, digit))
  }

  when(busy && !finished) {
    remainder := reduced
    quotient  := found(quotientBits - 1, 0)
    stepsLeft := stepsLeft - 1.U
  }
  when(io.quotient.fire)(busy := false.B)
  when(io.division.fire) {
    busy      := true.B
    stepsLeft := steps.U
    remainder := Cat(0.U(1.W), io.division.bits.numerator, 0.U(1.W))
    once      := io.division.bits.denominator
    thrice    := io.division.bits.denominator +& Cat(io.division.bits.denominator, 0.U(1.W))
  }

  io.division.ready := !busy || io.quotient.fire
  io.quotient.valid := finished
  io.quotient.bits  := quotient(quotientBits - 1, spareBits)
}

object Divider {

  /** Cycles of a division that compute quotient bits. */
  def steps(digits: Int, digitsPerCycle: Int = 1): Int = digits / (2 * digitsPerCycle) + 1
}

final class PipelinedDividerIO(mantissaBits: Int, digits: Int, lanes: Int, hasRest: Boolean, bitsPerStage: Int)
    extends Bundle {
  val loads = Input(Vec(PipelinedDivider.stages(digits, bitsPerStage), Bool())) // stage i loads from the stage before

  /** The numerator's top bit is set, or it is zero; the denominator's top bit is set. */
  val numerators  = Input(Vec(lanes, UInt(mantissaBits.W)))
  val denominator = Input(UInt(mantissaBits.W))

  val quotients = Output(Vec(lanes, UInt((digits + 1).W))) // ⌊numerator · 2^digits / denominator⌋

  /** A quotient is inexact. */
  val rests = Option.when(hasRest)(Output(Vec(lanes, Bool())))
}

/** Divides mantissas as [[Divider]] does, a division a cycle in each lane. The lanes share the denominator.
  *
  * Restoring recurrence in radix 2, two quotient bits a stage: two subtractors in series are a third smaller than the
  * three parallel ones of radix 4, and fit the cycle. Latency: ⌈(digits + 1) / bitsPerStage⌉ loads. A stage that does
  * not load holds its values.
  *
  * @param digits fraction bits of the quotient
  * @param lanes  numerators that are divided by the same denominator
  * @param hasRest it tells inexact quotients
  * @param bitsPerStage subtractors in series
  */
final class PipelinedDivider(
    mantissaBits: Int,
    digits:       Int,
    lanes:        Int,
    hasRest:      Boolean = false,
    bitsPerStage: Int = PipelinedDivider.bitsPerStage
) extends Module {
  import PipelinedDivider.stages
  require(mantissaBits >= 2, s"a divider of $mantissaBits-bit mantissas; they must have at least 2 bits")
  require(digits >= 0, s"a divider for $digits digits; it must be for at least 0")

  val io = IO(new PipelinedDividerIO(mantissaBits, digits, lanes, hasRest, bitsPerStage))

  /** A partial division: the remainder is less than twice the denominator. */
  private case class Partial(remainder: UInt, quotient: Option[UInt])

  private def step(from: Partial, denominator: UInt): Partial = {
    val (fits, rest) = DigitRecurrence.step(from.remainder, denominator, mantissaBits)
    Partial(Cat(rest, false.B), Some(from.quotient.fold(fits.asUInt)(Cat(_, fits))))
  }

  private val begin    = (io.numerators.map(n => Partial(Cat(false.B, n), None)).toSeq, io.denominator)
  private val (end, _) =
    (0 until stages(digits, bitsPerStage)).foldLeft(begin) { case ((partials, denominator), stage) =>
      val bits = bitsPerStage.min(digits + 1 - bitsPerStage * stage)
      val next = partials.map { partial =>
        val stepped = (0 until bits).foldLeft(partial)((each, _) => step(each, denominator))
        Partial(RegEnable(stepped.remainder, io.loads(stage)), stepped.quotient.map(RegEnable(_, io.loads(stage))))
      }
      (next, RegEnable(denominator, io.loads(stage)))
    }
  io.quotients.zip(end).foreach { case (to, partial) => to := partial.quotient.get }
  for (rests <- io.rests; (to, partial) <- rests.zip(end)) to := partial.remainder.orR
}

object PipelinedDivider {
  private val bitsPerStage = 2

  /** Latency of a division. */
  def stages(digits: Int, bitsPerStage: Int = bitsPerStage): Int = (digits + bitsPerStage) / bitsPerStage
}

final class FoldedDividerIO(numeratorBits: Int, denominatorBits: Int, digits: Int) extends Bundle {

  /** In one of `interval` cycles, always the same: the operands are there, and a quotient changes in the next cycle. */
  val isStep      = Input(Bool())
  val numerator   = Input(UInt(numeratorBits.W))
  val denominator = Input(UInt(denominatorBits.W))
  val quotient    = Output(UInt((digits + 1).W))
}

/** Divides mantissas of different widths, one division every `interval` cycles: ⌊n · 2^digits / d⌋ with
  * n = numerator / 2^numeratorBits and d = denominator / 2^denominatorBits. The denominator's top bit is set; the
  * numerator is less than twice the denominator in this sense.
  *
  * Restoring, three bits a cycle. A chain of stages, each of which works on a division for one interval. The quotient
  * comes `FoldedDivider.intervals` intervals after its operands and one cycle.
  */
final class FoldedDivider(numeratorBits: Int, denominatorBits: Int, digits: Int, interval: Int) extends Module {
  val io = IO(new FoldedDividerIO(numeratorBits, denominatorBits, digits))

  private val stages = FoldedDivider.intervals(digits, interval)
  private val found  = stages * FoldedDivider.perCycle * interval

  /** @param pending the numerator's bits that are still to come, above the digits found so far */
  final private class State extends Bundle {
    val remainder = UInt(denominatorBits.W)
    val divisor   = UInt(denominatorBits.W)
    val integer   = Bool()
    val pending   = UInt(found.W)
  }

  private def next(from: State): State = {
    val to = Wire(new State)
    to := from
    val (remainder, pending) = (0 until FoldedDivider.perCycle).foldLeft((from.remainder, from.pending)) {
      case ((remainder, pending), _) =>
        val (fits, rest) = DigitRecurrence.step(Cat(remainder, pending(found - 1)), from.divisor, denominatorBits)
        (rest, Cat(pending(found - 2, 0), fits))
    }
    to.remainder := remainder
    to.pending   := pending
    to
  }

  // The integer digit on the way in
  private val bits         = denominatorBits + found
  private val aligned      = Rounding.floor(io.numerator, numeratorBits - bits).pad(bits)
  private val (fits, rest) = DigitRecurrence.step(aligned(bits - 1, found), io.denominator, denominatorBits)
  private val entering     = Wire(new State)
  entering.remainder := rest
  entering.divisor   := io.denominator
  entering.integer   := fits
  entering.pending   := aligned(found - 1, 0)

  private val leaving = (0 until stages).foldLeft(entering) { (before, _) =>
    val state = Reg(new State)
    val after = next(state)
    state := Mux(io.isStep, before, after)
    after
  }
  private val quotient = Reg(UInt((digits + 1).W))
  when(io.isStep)(quotient := Cat(leaving.integer, leaving.pending)(found, found - digits))
  io.quotient := quotient
}

object FoldedDivider {
  val perCycle: Int = 3

  /** Intervals of a division. */
  def intervals(digits: Int, interval: Int): Int = (digits.max(1) - 1) / (perCycle * interval) + 1
}
