package colonnade.traversal

import chisel3._
import chisel3.util.{isPow2, log2Ceil, Cat}
import colonnade.common.Context
import colonnade.config.ColonnadeConfig

/** A sibling that waits. */
private[traversal] final class StackEntry(config: ColonnadeConfig) extends Bundle {
  val visit = new Visit(config)

  /** Where the ray enters it, in units. */
  val near = UInt((config.numbers.boxDistanceBits - 1).W)
}

private[traversal] object StackEntry {
  def apply(config: ColonnadeConfig, child: EnteredChild): StackEntry = {
    val entry = Wire(new StackEntry(config))
    entry.visit := child.visit
    entry.near  := child.near.integer.asUInt(config.numbers.boxDistanceBits - 2, 0) // never negative
    entry
  }
}

/** An operation in its second cycle. */
private[traversal] final class StackAnswer(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)

  /** An entry was read; otherwise `isDone` and `visit` are the answer. */
  val isPop  = Bool()
  val isDone = Bool()
  val visit  = new Visit(config)
  val limit  = SInt(config.numbers.boxDistanceBits.W)

  /** Entries left below the one that was read, and the address of their newest. */
  val level = StackLevel(config)
  val below = StackAddress(config)
}

/** Entries on a stack. */
private[traversal] object StackLevel {
  def apply(config: ColonnadeConfig): UInt = UInt(log2Ceil(config.columnBvhMemory.stackDepth + 1).W)
}

/** Where an entry lies: the stacks of all contexts follow one another. */
private[traversal] object StackAddress {
  def apply(config: ColonnadeConfig): UInt = UInt(log2Ceil(size(config)).W)

  def size(config: ColonnadeConfig): Int = config.array.contexts * config.columnBvhMemory.stackDepth

  /** Of the entry with `level` others below it. At the level of a full stack it belongs to nobody. */
  def apply(config: ColonnadeConfig, context: UInt, level: UInt): UInt = {
    val stackDepth = config.columnBvhMemory.stackDepth
    val bits       = apply(config).getWidth
    val address    =
      if (isPow2(stackDepth)) Cat(context, 0.U(log2Ceil(stackDepth).W)) + level
      else VecInit(Seq.tabulate(1 << context.getWidth)(c => (c * stackDepth).U((bits + 1).W)))(context) + level
    address(bits - 1, 0)
  }
}
