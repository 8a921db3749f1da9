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

final class FoldedSquareRootIO(radicandBits: Int) extends Bundle {

  /** In one of `interval` cycles, always the same: the radicand is there, and a root changes in the next cycle. */
  val isStep   = Input(Bool())
  val radicand = Input(UInt(radicandBits.W))

  val root = Output(UInt(SquareRoot.rootBits(radicandBits).W)) // ⌊√radicand⌋
}

/** Square roots, one every `interval` cycles, of radicands with an even number of bits.
  *
  * Restoring, three bits of the root a cycle. A chain of stages, each of which works on a root for one interval; the
  * first ones have short remainders and roots. The root comes `FoldedSquareRoot.intervals` intervals after its radicand
  * and one cycle.
  */
final class FoldedSquareRoot(radicandBits: Int, interval: Int) extends Module {
  require(radicandBits % 2 == 0, s"a square root of $radicandBits bits; they must be even")

  val io = IO(new FoldedSquareRootIO(radicandBits))

  private val rootBits = SquareRoot.rootBits(radicandBits)
  private val stages   = FoldedSquareRoot.intervals(radicandBits, interval)
  private val perStage = FoldedSquareRoot.perCycle * interval
  private val found    = stages * perStage

  /** Remainder, at most twice the root; root; unused bits of the radicand. */
  private type State = (UInt, UInt, UInt)

  private def digit(state: State): State = {
    val (remainder, root, pending) = state
    val (fits, rest)               =
      DigitRecurrence.step(Cat(remainder, pending.head(2)), Cat(root, 1.U(2.W)), root.getWidth + 2)
    (rest, Cat(root, fits), Cat(pending(pending.getWidth - 3, 0), 0.U(2.W)))
  }

  private val radicand = (io.radicand << (2 * found - radicandBits)).pad(2 * found)

  /** The end of the last stage. */
  private val (_, root, _) = (1 to stages).foldLeft((0.U(1.W), 0.U(1.W), radicand): State) { (before, stage) =>
    val count                   = stage * perStage
    val pending                 = Reg(UInt((2 * (found - count + perStage)).W))
    val root                    = Reg(UInt(count.W))
    val remainder               = Reg(UInt((count + 1).W))
    val (extended, roots, left) =
      (0 until FoldedSquareRoot.perCycle).foldLeft((remainder, root, pending): State)((state, _) => digit(state))
    val after: State = (extended(count, 0), roots(count - 1, 0), left)
    // The bits that the stages before have used are gone
    val entering = before._3
    remainder := Mux(io.isStep, before._1, after._1)
    root      := Mux(io.isStep, before._2, after._2)
    pending   := Mux(io.isStep, entering.head(pending.getWidth), after._3)
    after
  }
  private val result = Reg(UInt(rootBits.W))
  when(io.isStep)(result := root(found - 1, found - rootBits))
  io.root := result
}

object FoldedSquareRoot {
  val perCycle: Int = 3

  /** Intervals of a root. */
  def intervals(radicandBits: Int, interval: Int): Int =
    (SquareRoot.rootBits(radicandBits) - 1) / (perCycle * interval) + 1
}
