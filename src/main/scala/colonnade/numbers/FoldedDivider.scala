package colonnade.numbers

import chisel3._
import chisel3.util.Cat

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
  * Restoring, three bits a cycle. A chain of stages, each of which works on a division for one interval. The quotient comes
  * `FoldedDivider.intervals` intervals after its operands and one cycle.
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
