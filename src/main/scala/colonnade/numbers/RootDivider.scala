package colonnade.numbers

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled}

/** The operands of a square root or of a division of mantissas.
  *
  * @param operand   the radicand, or the denominator, whose top bit is set within the mantissa's bits
  * @param numerator of a division; less than twice the denominator
  */
final class RootOrDivision(radicandBits: Int, mantissaBits: Int) extends Bundle {
  val isDivision = Bool()
  val operand    = UInt(radicandBits.max(mantissaBits).W)
  val numerator  = UInt(mantissaBits.W)
}

final class RootDividerIO(radicandBits: Int, mantissaBits: Int, digits: Int) extends Bundle {
  val operation = Flipped(Decoupled(new RootOrDivision(radicandBits, mantissaBits)))

  /** ⌊√radicand⌋ or ⌊numerator · 2^digits / denominator⌋ */
  val result = Decoupled(UInt(RootDivider.resultBits(radicandBits, digits).W))
}

/** Square root and division with one subtractor, by restoring digit recurrence: one bit a cycle. It has half the area
  * of a [[SquareRoot]] and a [[Divider]].
  *
  * Latency rootBits + 1 or digits + 2 cycles, one operation at a time. The next operation can enter in the cycle in
  * which a result leaves.
  */
final class RootDivider(radicandBits: Int, mantissaBits: Int, digits: Int) extends Module {
  require(radicandBits >= 2 && radicandBits % 2 == 0, s"a square root of $radicandBits bits; they must be even")
  require(mantissaBits >= 1, s"a divider of $mantissaBits-bit mantissas; they must have at least 1 bit")
  require(digits >= 0, s"a divider for $digits digits; it must be for at least 0")

  val io = IO(new RootDividerIO(radicandBits, mantissaBits, digits))

  private val rootBits      = SquareRoot.rootBits(radicandBits)
  private val resultBits    = RootDivider.resultBits(radicandBits, digits)
  private val remainderBits = (rootBits + 3).max(mantissaBits + 1)

  private val busy       = RegInit(false.B)
  private val bitsLeft   = Reg(UInt(log2Ceil(rootBits.max(digits + 1) + 1).W))
  private val isDivision = Reg(Bool())
  private val result     = Reg(UInt(resultBits.W))

  /** The radicand's unused bits, left-aligned; or the denominator. */
  private val operand = Reg(chiselTypeOf(io.operation.bits.operand))

  private val remainder = Reg(UInt(remainderBits.W)) // at most twice the root, or less than twice the denominator

  private val finished = busy && bitsLeft === 0.U

  // The next bit is set if (2 root + 1)² or the denominator fits
  private val pair       = operand(radicandBits - 1, radicandBits - 2)
  private val minuend    = Mux(isDivision, remainder, Cat(remainder(remainderBits - 3, 0), pair))
  private val subtrahend =
    Mux(isDivision, operand(mantissaBits - 1, 0), Cat(result(rootBits - 1, 0), 1.U(2.W))).pad(remainderBits)
  private val (bit, rest) = DigitRecurrence.step(minuend, subtrahend, remainderBits)

  when(busy && !finished) {
    remainder := Mux(isDivision, Cat(rest(remainderBits - 2, 0), 0.U(1.W)), rest)
    result    := Cat(result, bit)(resultBits - 1, 0)
    bitsLeft  := bitsLeft - 1.U
    when(!isDivision)(operand := operand << 2)
  }
  when(io.result.fire)(busy := false.B)
  when(io.operation.fire) {
    busy       := true.B
    isDivision := io.operation.bits.isDivision
    bitsLeft   := Mux(io.operation.bits.isDivision, (digits + 1).U, rootBits.U)
    remainder  := Mux(io.operation.bits.isDivision, io.operation.bits.numerator, 0.U)
    operand    := io.operation.bits.operand
    result     := 0.U
  }

  io.operation.ready := !busy || io.result.fire
  io.result.valid    := finished
  io.result.bits     := result
}

object RootDivider {
  def resultBits(radicandBits: Int, digits: Int): Int = SquareRoot.rootBits(radicandBits).max(digits + 1)
}

/** A step of restoring division or square root: subtract, and keep the difference unless it is negative. */
object DigitRecurrence {

  /** The difference, and whether it is not negative. Operands that are padded more than the difference needs would make
    * firtool take the borrow for a constant.
    */
  def subtract(minuend: UInt, subtrahend: UInt): (Bool, UInt) = {
    val difference = minuend -& subtrahend
    (!difference.head(1).asBool, difference)
  }

  /** The digit, and what is left of the minuend, in `bits` bits. */
  def step(minuend: UInt, subtrahend: UInt, bits: Int): (Bool, UInt) = {
    val (fits, difference) = subtract(minuend, subtrahend)
    (fits, Mux(fits, difference, minuend)(bits - 1, 0))
  }
}

/** Adds without carrying: three terms become two with the same sum, modulo 2^width. */
object CarrySave {

  /** The sums and the carries of the bits of three terms of one width; `carryIn` is also added. */
  def apply(a: UInt, b: UInt, c: UInt, carryIn: Bool = false.B): (UInt, UInt) = {
    val width = a.getWidth
    require(b.getWidth == width && c.getWidth == width, s"terms of $width, ${b.getWidth} and ${c.getWidth} bits")
    (a ^ b ^ c, ((a & b) | (a & c) | (b & c))(width - 2, 0) ## carryIn)
  }
}
