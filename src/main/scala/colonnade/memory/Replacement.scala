package colonnade.memory

import chisel3._
import chisel3.util.log2Ceil

/** Pseudo-LRU replacement for one cache: a binary tree of bits for each set, which point away from recent uses.
  *
  * Each node halves its ways; halves of an odd number differ by one. So a number of ways that is no power of two is
  * possible, and its ways are not replaced equally often: at most twice as often as others.
  *
  * @param sets sets of the cache
  * @param ways ways of a set
  */
private[memory] final class Replacement(sets: Int, ways: Int) {
  private val wayBits = log2Ceil(ways.max(2))

  /** Node n lies between the ways n and n + 1. A set bit leads to the upper half. */
  private val trees = RegInit(VecInit(Seq.fill(sets)(0.U((ways - 1).max(1).W))))

  /** The way to replace. */
  def victim(set: UInt): UInt = {
    val tree                              = trees(set)
    def among(first: Int, end: Int): UInt =
      if (end - first == 1) first.U(wayBits.W)
      else {
        val upper = (first + end) / 2
        Mux(tree(upper - 1), among(upper, end), among(first, upper))
      }
    among(0, ways)
  }

  /** Marks a way as used. */
  def use(set: UInt, way: UInt): Unit = if (ways > 1) {
    val tree                               = trees(set)
    val updated                            = Wire(Vec(ways - 1, Bool()))
    def update(first: Int, end: Int): Unit = if (end - first > 1) {
      val upper = (first + end) / 2
      updated(upper - 1) := Mux(way >= first.U && way < end.U, way < upper.U, tree(upper - 1))
      update(first, upper)
      update(upper, end)
    }
    update(0, ways)
    trees(set) := updated.asUInt
  }
}
