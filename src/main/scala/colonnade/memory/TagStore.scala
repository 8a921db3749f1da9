package colonnade.memory

import chisel3._
import chisel3.util.{log2Ceil, Fill, PriorityEncoder, UIntToOH, Valid}

/** Which lines one bank of a cache holds, and where: a memory of tags with a single port, valid bits and the
  * replacement.
  *
  * @param sets     sets of the bank, a power of two
  * @param ways     ways of a set
  * @param lineBits width of the number of a line
  * @param inMemory
  *   valid bits and the replacement lie in memories, with a flag for each set that it was written; tags are read before
  * a
  *   register, not behind one
  */
private[memory] final class TagStore(sets: Int, ways: Int, lineBits: Int, inMemory: Boolean) {
  private val setBits     = log2Ceil(sets)
  private val tagBits     = (lineBits - setBits).max(1)
  private val tags        = Option.unless(inMemory)(SyncReadMem(sets, Vec(ways, UInt(tagBits.W))))
  private val earlyTags   = Option.when(inMemory)(Mem(sets, Vec(ways, UInt(tagBits.W))))
  private val found       = Wire(Vec(ways, UInt(tagBits.W)))
  private val replacement = new Replacement(sets, ways, inMemory)

  /** By set: a bit for each way, or whether `validMemory` has them. */
  private val isValid     = RegInit(VecInit(Seq.fill(sets)(0.U((if (inMemory) 1 else ways).W))))
  private val validMemory = Option.when(inMemory)(Mem(sets, UInt(ways.W)))

  /** The valid bits of a set are read with its tags, or in the next cycle from the memory: no set changes in the cycle
    * in which its tags are read.
    */
  private val foundValid = Option.unless(inMemory)(Wire(UInt(ways.W)))

  private def setOf(line: UInt): UInt = line.pad(setBits + 1)(setBits - 1, 0)
  private def tagOf(line: UInt): UInt = (line >> setBits).asUInt.pad(tagBits)(tagBits - 1, 0)

  private def validOf(line: UInt): UInt = {
    val bits = isValid(setOf(line))
    validMemory.fold(bits)(memory => Fill(ways, bits) & memory(setOf(line)))
  }

  /** Uses the port: writes the tag of a line, or else reads the tags of its set for the next cycle. Call it once. */
  def access(line: UInt, way: UInt, isRead: Bool, isWrite: Bool): Unit = {
    foundValid.foreach(_ := RegNext(validOf(line)))
    val written = VecInit(Seq.fill(ways)(tagOf(line)))
    val mask    = UIntToOH(way, ways).asBools
    for (memory <- tags) found := memory.readWrite(setOf(line), written, mask, isRead || isWrite, isWrite)
    for (memory <- earlyTags) {
      found := RegNext(memory(setOf(line)))
      when(isWrite) { memory.write(setOf(line), written, mask) }
    }
  }

  /** The way that holds a line, one-hot; 0 if none does. The tags of its set were read in the cycle before. */
  def hitOH(line: UInt): UInt = VecInit(found.map(_ === tagOf(line))).asUInt & foundValid.getOrElse(validOf(line))

  /** The way for a new line: an empty one, or the one to replace. */
  def victim(line: UInt): UInt = {
    val free = ~validOf(line)
    Mux(free.orR, PriorityEncoder(free), replacement.victim(setOf(line)))
  }

  /** Marks a way of the line's set as used. */
  def use(line: UInt, way: UInt): Unit = replacement.use(setOf(line), way)

  /** From the next cycle the way holds the line, or nothing. */
  def replace(line: UInt, way: UInt, isKept: Bool): Unit = {
    val rest = validOf(line) & ~UIntToOH(way, ways)
    val bits = Mux(isKept, rest | UIntToOH(way, ways), rest)
    validMemory.foreach(_.write(setOf(line), bits))
    isValid(setOf(line)) := validMemory.fold(bits)(_ => 1.U)
    replacement.use(setOf(line), way)
  }

  /** The number of a line's place in the bank: the places of a way follow each other. */
  def place(line: UInt, way: UInt): UInt = way ## line.pad(setBits + 1)(setBits - 1, 0)

  /** Forgets all lines. */
  def clear(): Unit = isValid.foreach(_ := 0.U)
}

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
