package colonnade.numbers

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled}

final class SquareRootIO(radicandBits: Int) extends Bundle {
  val radicand = Flipped(Decoupled(UInt(radicandBits.W)))
  val root     = Decoupled(UInt(SquareRoot.rootBits(radicandBits).W)) // ⌊√radicand⌋
}

/** Square root by restoring digit recurrence. Each cycle takes two bits of the radicand and gives one bit of the root.
  *
  * Latency rootBits + 1 cycles, one root at a time. The next radicand can enter in the cycle in which a root leaves.
  */
final class SquareRoot(radicandBits: Int) extends Module {
  require(radicandBits >= 1, s"a square root of $radicandBits bits; there must be at least 1")

  val io = IO(new SquareRootIO(radicandBits))

  private val rootBits = SquareRoot.rootBits(radicandBits)

  private val busy      = RegInit(false.B)
  private val bitsLeft  = Reg(UInt(log2Ceil(rootBits + 1).W))
  private val pending   = Reg(UInt((2 * rootBits).W)) // the radicand's unused bits, left-aligned
  private val root      = Reg(UInt(rootBits.W))
  private val remainder = Reg(UInt((rootBits + 1).W)) // always at most twice the root

  private val finished = busy && bitsLeft === 0.U

  // The next bit is set if (2 root + 1)² fits, that is if 4 root + 1 does not exceed the remainder
  private val extended    = Cat(remainder, pending(2 * rootBits - 1, 2 * rootBits - 2))
  private val (bit, rest) = DigitRecurrence.step(extended, Cat(0.U(1.W), root, 1.U(2.W)), rootBits + 1)

  when(busy && !finished) {
    remainder := rest
    root      := Cat(root, bit)(rootBits - 1, 0)
    pending   := Cat(pending, 0.U(2.W))(2 * rootBits - 1, 0)
    bitsLeft  := bitsLeft - 1.U
  }
  when(io.root.fire)(busy := false.B)
  when(io.radicand.fire) {
    busy      := true.B
    bitsLeft  := rootBits.U
    remainder := 0.U
    root      := 0.U
    pending   := io.radicand.bits
  }

  io.radicand.ready := !busy || io.root.fire
  io.root.valid     := finished
  io.root.bits      := root
}

object SquareRoot {
  def rootBits(radicandBits: Int): Int = (radicandBits + 1) / 2
}
