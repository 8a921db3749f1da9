package colonnade.numbers

import chisel3._
import chisel3.util.Cat

final class FoldedSquareRootIO(radicandBits: Int) extends Bundle {

  /** In one of `interval` cycles, always the same: the radicand is there, and a root changes in the next cycle. */
  val isStep   = Input(Bool())
  val radicand = Input(UInt(radicandBits.W))

  val root = Output(UInt(SquareRoot.rootBits(radicandBits).W)) // ⌊√radicand⌋
}

/** Square roots, one every `interval` cycles, of radicands with an even number of bits.
  *
  * Restoring, three bits of the root a cycle. A chain of stages, each of which works on a root for one interval; the first
  * ones have short remainders and roots. The root comes `FoldedSquareRoot.intervals` intervals after its radicand and one
  * cycle.
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
