package colonnade.memory

import chisel3._
import chisel3.util.{log2Ceil, Valid}

/** Pseudo-LRU replacement for one cache: a binary tree of bits for each set, which point away from recent uses.
  *
  * Each node halves its ways; halves of an odd number differ by one. So a number of ways that is no power of two is
  * possible, and its ways are not replaced equally often: at most twice as often as others.
  *
  * @param sets sets of the cache
  * @param ways ways of a set
  * @param inMemory
  *   the trees lie in a memory, one of them is updated in a cycle: the one of the last use, in the order of the code
  */
private[memory] final class Replacement(sets: Int, ways: Int, inMemory: Boolean = false) {
  private val wayBits = log2Ceil(ways.max(2))

  // Node n of a tree lies between the ways n and n + 1. A set bit leads to the upper half
  private val treeBits  = (ways - 1).max(1)
  private val registers = Option.unless(inMemory)(RegInit(VecInit(Seq.fill(sets)(0.U(treeBits.W)))))
  private val memory    = Option.when(inMemory)(Mem(sets, UInt(treeBits.W)))

  /** The use that updates the memory: set and way. */
  private val lastUse = Option.when(inMemory)(WireDefault(Valid(new Use), 0.U.asTypeOf(Valid(new Use))))
  for (trees <- memory; last <- lastUse if ways > 1) when(last.valid) {
    trees(last.bits.set) := updated(trees(last.bits.set), last.bits.way)
  }

  private final class Use extends Bundle {
    val set = UInt(log2Ceil(sets).max(1).W)
    val way = UInt(wayBits.W)
  }

  private def treeOf(set: UInt): UInt = registers.fold(memory.get(set))(_(set))

  /** The way to replace. */
  def victim(set: UInt): UInt = {
    val tree                              = treeOf(set)
    def among(first: Int, end: Int): UInt =
      if (end - first == 1) first.U(wayBits.W)
      else {
        val upper = (first + end) / 2
        Mux(tree(upper - 1), among(upper, end), among(first, upper))
      }
    among(0, ways)
  }

  /** Marks a way as used. */
  def use(set: UInt, way: UInt): Unit = {
    for (trees <- registers if ways > 1) trees(set) := updated(trees(set), way)
    for (last <- lastUse) {
      last.valid    := true.B
      last.bits.set := set
      last.bits.way := way
    }
  }

  /** The tree after a use. */
  private def updated(tree: UInt, way: UInt): UInt = {
    val nodes                              = Wire(Vec(ways - 1, Bool()))
    def update(first: Int, end: Int): Unit = if (end - first > 1) {
      val upper = (first + end) / 2
      nodes(upper - 1) := Mux(way >= first.U && way < end.U, way < upper.U, tree(upper - 1))
      update(first, upper)
      update(upper, end)
    }
    update(0, ways)
    nodes.asUInt
  }
}
