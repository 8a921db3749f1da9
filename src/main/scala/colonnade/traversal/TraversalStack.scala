package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Queue, Valid}
import colonnade.common.Context
import colonnade.config.ColonnadeConfig
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.RayFormats

/** What a ray does next. */
final class NextVisit(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)

  /** Nothing is left; `visit` is meaningless. */
  val isDone = Bool()
  val visit  = new Visit(config)
}

/** Ports of [[TraversalStack]]. */
final class TraversalStackIO(config: ColonnadeConfig) extends Bundle {

  /** Empties the stack of a context, which has nothing under way here: a new ray. */
  val start = Flipped(Valid(Context(config)))

  /** What a ray found in a node; constant while it waits. */
  val results = Flipped(Decoupled(new BoxResult(config)))

  /** A ray that has finished a leaf. */
  val resume = Flipped(Decoupled(Context(config)))

  /** Largest near that counts, in units; up to date for a context whose result or resumption is offered. */
  val limits = Input(Vec(config.array.contexts, new Fixed(new RayFormats(config.numbers).units)))
  val visits = Decoupled(new NextVisit(config))

  /** An entry did not fit and was dropped. */
  val overflow = Output(Bool())

  /** Starts the measurement of `deepest`: most entries of any stack. */
  val clear   = Input(Bool())
  val deepest = Output(StackLevel(config))

  /** The unit holds work. */
  val busy = Output(Bool())
}

/** Depth-first order for all contexts: the siblings that wait, in one memory with one port.
  *
  * A result sends its ray to the nearest child and pushes the others, far first; one without children, and a
  * resumption, pop. Popped entries that begin beyond the ray's limit are dropped. Each result or resumption is answered
  * by one visit. A context has at most one of them under way, so that answers of a context can't overtake.
  *
  * Throughput: one operation a cycle; each push beyond the first and each dropped entry takes one more. Latency: one
  * cycle after the last of them. Results and resumptions take turns.
  */
class TraversalStack(config: ColonnadeConfig) extends Module {
  private val arity      = config.geometry.arity
  private val contexts   = config.array.contexts
  private val stackDepth = config.columnBvhMemory.stackDepth

  val io = IO(new TraversalStackIO(config))

  private val entries = SyncReadMem(StackAddress.size(config), UInt(new StackEntry(config).getWidth.W))
  private val levels  = RegInit(VecInit.fill(contexts)(0.U.asTypeOf(StackLevel(config))))
  private val answers = Module(new Queue(new NextVisit(config), TraversalStack.answers, flow = true))

  // The second cycle of an operation: its answer, or the entry that was read
  private val isAnswering = RegInit(false.B)
  private val answer      = Reg(new StackAnswer(config))
  private val entry       = Wire(new StackEntry(config))
  private val isDropped   = answer.isPop && entry.near.zext > answer.limit
  private val popsAgain   = isAnswering && isDropped && answer.level =/= 0.U
  answers.io.enq.valid        := isAnswering && !popsAgain
  answers.io.enq.bits.context := answer.context
  answers.io.enq.bits.isDone  := Mux(answer.isPop, isDropped, answer.isDone)
  answers.io.enq.bits.visit   := Mux(answer.isPop, entry.visit, answer.visit)
  io.visits :<>= answers.io.deq
  assert(!answers.io.enq.valid || answers.io.enq.ready, "an operation was begun without a place for its answer")

  // Choose an operation: pop again, go on with a result's pushes, or take turns
  private val pushesDone  = RegInit(0.U(log2Ceil(arity).W))
  private val resumedLast = RegInit(false.B)
  private val hasRoom     = answers.io.count +& isAnswering < TraversalStack.answers.U
  private val begins      = hasRoom && !popsAgain && (io.results.valid || io.resume.valid)
  private val takesResult = io.results.valid && (!io.resume.valid || resumedLast || pushesDone =/= 0.U)
  private val count       = io.results.bits.count
  private val wantsPush   = takesResult && count > 1.U
  private val wantsPop    = !takesResult || count === 0.U
  private val isLastPush  = pushesDone +& 2.U >= count
  private val ends        = begins && (!wantsPush || isLastPush)
  io.results.ready               := ends && takesResult
  io.resume.ready                := ends && !takesResult
  when(ends)(resumedLast               := !takesResult)
  when(begins && wantsPush)(pushesDone := Mux(isLastPush, 0.U, pushesDone + 1.U))

  // What it does to its stack
  private val context = Mux(takesResult, io.results.bits.context, io.resume.bits)
  private val level   = element(levels, context)
  private val isFull  = level === stackDepth.U
  private val pushes  = begins && wantsPush && !isFull
  private val pops    = begins && wantsPop && level =/= 0.U
  when(pushes || pops || popsAgain) {
    val changed = Mux(popsAgain, answer.context, context)
    element(levels, changed) := Mux(popsAgain, answer.level - 1.U, Mux(pops, level - 1.U, level + 1.U))
  }
  when(io.start.valid)(element(levels, io.start.bits) := 0.U)

  // Read or write the memory, never both
  private val free    = StackAddress(config, context, level)
  private val address = Mux(popsAgain, answer.below, Mux(wantsPop, free - 1.U, free))
  private val child   = io.results.bits.children(Rounding.narrow(count - 1.U - pushesDone, log2Ceil(arity)))
  private val reads   = pops || popsAgain
  entry := entries.readWrite(address, StackEntry(config, child).asUInt, reads || pushes, pushes).asTypeOf(entry)

  // On to the second cycle
  isAnswering := ends || popsAgain
  when(popsAgain) {
    answer.level := answer.level - 1.U
    answer.below := answer.below - 1.U
  }.elsewhen(ends) {
    answer.context := context
    answer.isPop   := pops
    answer.isDone  := wantsPop
    answer.visit   := io.results.bits.children(0).visit
    answer.limit   := element(io.limits, context).integer
    answer.level   := level - 1.U
    answer.below   := free - 2.U
  }

  // Measurements
  private val deepest = RegInit(0.U.asTypeOf(StackLevel(config)))
  when(io.clear)(deepest := 0.U).elsewhen(pushes && level >= deepest)(deepest := level + 1.U)
  io.deepest := deepest
  io.overflow := begins && wantsPush && isFull
  io.busy := isAnswering || answers.io.deq.valid || pushesDone =/= 0.U

  private def element[T <: Data](all: Vec[T], context: UInt): T =
    if (contexts == 1) all.head else all(context)
}

object TraversalStack {

  /** Visits that may wait: enough for an operation a cycle. */
  private val answers: Int = 3
}
