package colonnade.traversal

import chisel3._
import chisel3.util.{isPow2, log2Ceil, Cat}
import colonnade.common.Context
import colonnade.config.TraversalConfig

/** A child that the ray visits later. */
private[traversal] final class StackEntry(config: TraversalConfig) extends Bundle {
  val target = new NodeRef(config)

  /** Its entry distance, in units. */
  val tNear = UInt((config.numbers.boxDistanceBits - 1).W)
}

private[traversal] object StackEntry {
  def apply(config: TraversalConfig, child: EnteredChild): StackEntry = {
    val entry = Wire(new StackEntry(config))
    entry.target := child.target
    entry.tNear  := child.tNear.integer.asUInt(config.numbers.boxDistanceBits - 2, 0) // never negative
    entry
  }
}

/** A stack operation in its second cycle. */
private[traversal] final class PendingOperation(config: TraversalConfig) extends Bundle {
  val context = Context(config)

  /** An entry was read; otherwise `isDone` and `target` are the result. */
  val isPop  = Bool()
  val isDone = Bool()
  val target = new NodeRef(config)
  val tMax   = SInt(config.numbers.boxDistanceBits.W)

  /** Entries left below the one that was read, and the address of the newest of them. */
  val level       = StackLevel(config)
  val nextAddress = StackAddress(config)
}

/** The number of entries on a stack. */
private[traversal] object StackLevel {
  def apply(config: TraversalConfig): UInt = UInt(log2Ceil(config.device.columnBvhMemory.stackDepth + 1).W)
}

/** The address of an entry; the stacks of all contexts share one memory. */
private[traversal] object StackAddress {
  def apply(config: TraversalConfig): UInt = UInt(log2Ceil(size(config)).W)

  def size(config: TraversalConfig): Int = config.contexts * config.device.columnBvhMemory.stackDepth

  /** The address of the entry above `level` others. It is invalid for the level of a full stack. */
  def apply(config: TraversalConfig, context: UInt, level: UInt): UInt = {
    val stackDepth = config.device.columnBvhMemory.stackDepth
    val bits       = apply(config).getWidth
    val address    =
      if (isPow2(stackDepth)) Cat(context, 0.U(log2Ceil(stackDepth).W)) + level
      else VecInit(Seq.tabulate(1 << context.getWidth)(c => (c * stackDepth).U((bits + 1).W)))(context) + level
    address(bits - 1, 0)
  }
}
