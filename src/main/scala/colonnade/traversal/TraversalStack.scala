package colonnade.traversal

import chisel3._
import chisel3.util.{isPow2, log2Ceil, Cat, Decoupled, Queue, Valid}
import colonnade.common.{Context, TimingSlice}
import colonnade.config.TraversalConfig
import colonnade.formats.NodeRecord
import colonnade.numbers.Rounding

/** The next step of a ray: a record to visit, or the end of traversal. */
final class TraversalStep(config: TraversalConfig) extends Bundle {
  val context = Context(config)

  /** The traversal has ended; `target` is invalid. */
  val isDone = Bool()
  val target = new NodeRef(config)
}

final class TraversalStackIO(config: TraversalConfig) extends Bundle {

  /** Clears the stack of a context for a new ray; the context has no operation in flight. */
  val start = Flipped(Valid(Context(config)))

  /** The box test of a node, constant while it waits; a context that has finished a leaf. */
  val results = Flipped(Decoupled(new BoxResult(config)))
  val resume  = Flipped(Decoupled(Context(config)))

  /** Of the operation that starts; up to date for an offered operation. */
  val tMax  = new TMaxReader(config)
  val steps = Decoupled(new TraversalStep(config))

  val overflow = Output(Bool()) // an entry was dropped because the stack was full

  /** Resets `deepest`, the maximum number of entries of any stack. */
  val clear   = Input(Bool())
  val deepest = Output(StackLevel(config))

  val busy = Output(Bool()) // an operation is in flight
}

/** The stacks of all contexts for depth-first traversal, in one single-port memory.
  *
  * A result sends its ray to the nearest child and pushes the others, the farthest first. A result without children and
  * a resumption pop an entry. Popped entries whose entry distance exceeds `tMax` are culled. Each result or resumption
  * gives one step. A context has at most one operation in flight, so its steps stay in order.
  *
  * Throughput: one operation per cycle, plus one cycle for each push beyond the first and each culled entry. Latency:
  * one cycle after the last of these. With `units.extraSlices` each read of an entry, and a step, take a cycle more. A
  * round-robin arbiter selects between results and resumptions.
  */
class TraversalStack(config: TraversalConfig) extends Module {
  private val arity      = NodeRecord.most
  private val contexts   = config.contexts
  private val stackDepth = config.device.columnBvhMemory.stackDepth

  val io = IO(new TraversalStackIO(config))

  private val entries   = SyncReadMem(StackAddress.size(config), UInt(new StackEntry(config).getWidth.W))
  private val levels    = RegInit(VecInit.fill(contexts)(0.U.asTypeOf(StackLevel(config))))
  private val slice     = TimingSlice.extra(config.device)
  private val stepQueue =
    Module(new Queue(new TraversalStep(config), TraversalStack.stepQueueDepth, flow = !slice.isEnabled))

  // An extra slice registers the entry that was read and its comparison, in a cycle between the two of a pop
  private val readsEntry = WireInit(false.B)
  private val isRead     = slice.flag(readsEntry)
  private val isReading  = if (slice.isEnabled) isRead else false.B

  // Second cycle of an operation: its result, or the entry that was read
  private val isSecondCycle = RegInit(false.B)
  private val operation     = Reg(new PendingOperation(config))
  private val entryNow      = Wire(new StackEntry(config))
  private val exceedsNow    = entryNow.tNear.zext > operation.tMax
  private val entry         = slice(entryNow, isReading)
  private val exceeds       = slice(exceedsNow, isReading)
  private val isDropped     = operation.isPop && exceeds
  private val popsAgain     = isSecondCycle && isDropped && operation.level =/= 0.U
  stepQueue.io.enq.valid        := isSecondCycle && !popsAgain
  stepQueue.io.enq.bits.context := operation.context
  stepQueue.io.enq.bits.isDone  := Mux(operation.isPop, isDropped, operation.isDone)
  stepQueue.io.enq.bits.target  := Mux(operation.isPop, entry.target, operation.target)
  io.steps :<>= stepQueue.io.deq
  assert(!stepQueue.io.enq.valid || stepQueue.io.enq.ready, "an operation was started without queue space for its step")

  // Select an operation: pop again, continue the pushes of a result, or alternate between results and resumptions
  private val pushesDone    = RegInit(0.U(log2Ceil(arity).W))
  private val resumedLast   = RegInit(false.B)
  private val hasSpace      = stepQueue.io.count +& (isSecondCycle || isReading) < TraversalStack.stepQueueDepth.U
  private val starts        = hasSpace && !popsAgain && !isReading && (io.results.valid || io.resume.valid)
  private val selectsResult = io.results.valid && (!io.resume.valid || resumedLast || pushesDone =/= 0.U)
  private val count         = io.results.bits.count
  private val needsPush     = selectsResult && count > 1.U
  private val needsPop      = !selectsResult || count === 0.U
  private val isLastPush    = pushesDone +& 2.U >= count
  private val completes     = starts && (!needsPush || isLastPush)
  io.results.ready          := completes && selectsResult
  io.resume.ready           := completes && !selectsResult
  when(completes)(resumedLast          := !selectsResult)
  when(starts && needsPush)(pushesDone := Mux(isLastPush, 0.U, pushesDone + 1.U))

  // Update the level of the stack
  private val context = Mux(selectsResult, io.results.bits.context, io.resume.bits)
  io.tMax.context := context
  private val level  = element(levels, context)
  private val isFull = level === stackDepth.U
  private val pushes = starts && needsPush && !isFull
  private val pops   = starts && needsPop && level =/= 0.U
  when(pushes || pops || popsAgain) {
    val changed = Mux(popsAgain, operation.context, context)
    element(levels, changed) := Mux(popsAgain, operation.level - 1.U, Mux(pops, level - 1.U, level + 1.U))
  }
  when(io.start.valid)(element(levels, io.start.bits) := 0.U)

  // Access the memory: read or write, never both
  private val freeAddress = StackAddress(config, context, level)
  private val address     = Mux(popsAgain, operation.nextAddress, Mux(needsPop, freeAddress - 1.U, freeAddress))
  private val child       = io.results.bits.children(Rounding.narrow(count - 1.U - pushesDone, log2Ceil(arity)))
  private val reads       = pops || popsAgain
  entryNow := entries.readWrite(address, StackEntry(config, child).asUInt, reads || pushes, pushes).asTypeOf(entryNow)

  // Start the second cycle
  readsEntry    := (completes && pops) || popsAgain
  isSecondCycle := (completes && !pops) || isRead
  when(popsAgain) {
    operation.level       := operation.level - 1.U
    operation.nextAddress := operation.nextAddress - 1.U
  }.elsewhen(completes) {
    operation.context     := context
    operation.isPop       := pops
    operation.isDone      := needsPop
    operation.target      := io.results.bits.children(0).target
    operation.tMax        := io.tMax.units.integer
    operation.level       := level - 1.U
    operation.nextAddress := freeAddress - 2.U
  }

  // Statistics and errors
  private val deepest = RegInit(0.U.asTypeOf(StackLevel(config)))
  when(io.clear)(deepest := 0.U).elsewhen(pushes && level >= deepest)(deepest := level + 1.U)
  io.deepest := deepest
  io.overflow := starts && needsPush && isFull
  io.busy := isSecondCycle || isReading || stepQueue.io.deq.valid || pushesDone =/= 0.U

  private def element[T <: Data](all: Vec[T], context: UInt): T = if (contexts == 1) all.head else all(context)
}

object TraversalStack {
  private val stepQueueDepth: Int = 3 // queued steps: enough for one operation per cycle
}

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
