package colonnade.numbers

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled}

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

/** Divides mantissas by restoring digit recurrence in radix 4. Three parallel subtractors try one, two and three times the
  * denominator; the largest multiple that fits gives two quotient bits.
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
