package colonnade.refit

import chisel3._
import chisel3.util._
import colonnade.config.ColonnadeConfig

final class PlanReaderIO(config: ColonnadeConfig) extends Bundle {
  val start    = Input(Bool()) // a pulse, while idle
  val settings = Input(new RefitSettings(config))

  /** To [[RefitReader]]. */
  val lines = Vec(2, Decoupled(UInt((settings.plan.getWidth - log2Ceil(RefitPlan.lineBytes)).W)))
  val data  = Flipped(Valid(UInt(RefitPlan.entryBits.W))) // of the plan

  /** All entries; entries of lines after these have been requested. */
  val entries = Decoupled(new RefitEntry(config))

  /** Lines of vertices that no entry waits for any more. */
  val retired = Input(UInt(2.W))

  val isIdle  = Output(Bool())
  val isError = Output(Bool()) // a pulse: a line is not there, and another one is read
}

/** Reads the plan ahead, and requests the lines of vertices that it names. At most [[RefitPlan.linesInFlight]] of them are
  * on their way.
  */
final class PlanReader(config: ColonnadeConfig) extends Module {
  val io = IO(new PlanReaderIO(config))

  // Lines of the plan, each with space in the queue
  private val unread = RegInit(0.U(RefitPlan.countBits.W)) // entries without a request
  private val next   = Reg(chiselTypeOf(io.lines(0).bits))
  private val taken  = RegInit(0.U(log2Ceil(PlanReader.depth + 1).W))
  private val left   = RegInit(0.U(RefitPlan.countBits.W)) // entries that have not left
  private val queue  = Module(new Queue(new RefitEntry(config), PlanReader.depth, useSyncReadMem = true))
  private val plan   = io.lines(0)
  plan.valid := unread =/= 0.U && taken <= (PlanReader.depth - RefitPlan.lineEntries).U
  plan.bits  := next
  when(plan.fire) {
    next   := next + 1.U
    unread := Mux(unread > RefitPlan.lineEntries.U, unread - RefitPlan.lineEntries.U, 0.U)
  }
  taken              := taken + (plan.fire ## 0.U(2.W)) - queue.io.deq.fire
  queue.io.enq.valid := io.data.valid
  queue.io.enq.bits  := io.data.bits.asTypeOf(queue.io.enq.bits)

  // Lines of vertices, one a cycle; then their entry leaves
  private val ahead    = Module(new Queue(new RefitEntry(config), PlanReader.depth, useSyncReadMem = true))
  private val entry    = queue.io.deq.bits
  private val index    = RegInit(0.U(2.W))
  private val inFlight = RegInit(0.U(log2Ceil(RefitPlan.linesInFlight + 1).W))
  private val isLine   = left =/= 0.U && entry.kind === RefitKind.lines && index =/= entry.count
  private val line     = entry.line(index)
  private val isKnown  = line < io.settings.lines
  private val request  = io.lines(1)
  request.valid := queue.io.deq.valid && isLine && inFlight =/= RefitPlan.linesInFlight.U
  request.bits  := (io.settings.vertices >> log2Ceil(RefitPlan.lineBytes)) + Mux(isKnown, line, 0.U)
  when(request.fire) { index := index + 1.U }
  inFlight := inFlight + request.fire - io.retired

  // What is behind the last entry in its line is dropped
  ahead.io.enq.valid := queue.io.deq.valid && left =/= 0.U && !isLine
  ahead.io.enq.bits  := entry
  queue.io.deq.ready := left === 0.U || (!isLine && ahead.io.enq.ready)
  when(ahead.io.enq.fire) {
    index := 0.U
    left  := left - 1.U
  }
  io.entries :<>= ahead.io.deq

  when(io.start) {
    next   := io.settings.plan >> log2Ceil(RefitPlan.lineBytes)
    unread := io.settings.entries
    left   := io.settings.entries
  }
  io.isIdle  := left === 0.U && taken === 0.U && ahead.io.count === 0.U
  io.isError := request.fire && !isKnown
}

object PlanReader {
  val depth: Int = 64 // entries that are read ahead, before and after their lines are requested
}
