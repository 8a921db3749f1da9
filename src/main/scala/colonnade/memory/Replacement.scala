package colonnade.memory

import chisel3._
import chisel3.util.{isPow2, log2Ceil, UIntToOH}

/** Pseudo-LRU replacement for one cache: a binary tree of bits for each set, which point away from recent uses.
  *
  * @param sets sets of the cache
  * @param ways ways of a set, a power of two
  */
private[memory] final class Replacement(sets: Int, ways: Int) {
  require(isPow2(ways))
  private val levels = log2Ceil(ways)

  /** Node n has the children 2n and 2n + 1; the root is node 1. A set bit leads to the upper half. */
  private val trees = RegInit(VecInit(Seq.fill(sets)(0.U(ways.W))))

  /** The way to replace. */
  def victim(set: UInt): UInt = if (ways == 1) 0.U
  else {
    val tree = trees(set)
    (0 until levels).foldLeft(1.U(1.W): UInt)((node, _) => node ## tree(node.pad(levels)))(levels - 1, 0)
  }

  /** Marks a way as used. */
  def use(set: UInt, way: UInt): Unit = if (ways > 1) {
    val updates = (0 until levels).map { level =>
      val node = 1.U(1.W) ## way(levels - 1, 0).head(level)
      val bit  = way(levels - 1 - level)
      val mask = UIntToOH(node, ways)
      (mask, Mux(bit, 0.U, mask))
    }
    val (clears, sets) = updates.unzip
    trees(set) := (trees(set) & ~clears.reduce(_ | _)).asUInt | sets.reduce(_ | _)
  }
}
