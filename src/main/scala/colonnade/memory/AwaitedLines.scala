package colonnade.memory

import chisel3._
import chisel3.util.{log2Ceil, Decoupled}
import colonnade.config.ColonnadeConfig

/** A line to come from DRAM, and the buses that announce it when it comes. */
private[memory] final class AwaitedLine(config: ColonnadeConfig) extends Bundle {
  val line = UInt(Lines.lineBits(config).W)

  /** One bit for each bus. */
  val buses = UInt(SharedCache.buses(config).W)
}

private[memory] final class AwaitedLinesIO(config: ColonnadeConfig) extends Bundle {

  /** A line that is looked up; whether it is awaited. */
  val lookup    = Input(new AwaitedLine(config))
  val isAwaited = Output(Bool())

  /** The line that is looked up is also awaited for its buses. */
  val joins = Input(Bool())

  /** The line that is looked up is awaited from now on. */
  val enter  = Flipped(Decoupled())
  val isBusy = Output(Bool()) // half of the entries are used, or more
  val reads  = Decoupled(UInt(Lines.lineBits(config).W))
  val oldest = Decoupled(new AwaitedLine(config))
}

/** The lines of a bank that are awaited from DRAM, in order. */
private[memory] final class AwaitedLines(config: ColonnadeConfig, count: Int) extends Module {
  val io = IO(new AwaitedLinesIO(config))

  private val lines  = Reg(Vec(count, new AwaitedLine(config)))
  private val isUsed = RegInit(VecInit(Seq.fill(count)(false.B)))
  private val isSent = Reg(Vec(count, Bool()))
  private val used   = RegInit(0.U(log2Ceil(count + 1).W))
  private val tail   = new RingPointer(count)
  private val sender = new RingPointer(count)
  private val head   = new RingPointer(count)

  private val matches = lines.zip(isUsed).map { case (entry, used) => used && entry.line === io.lookup.line }
  used            := used + io.enter.fire - io.oldest.fire
  io.isBusy       := used >= ((count + 1) / 2).U
  io.isAwaited    := matches.reduce(_ || _)
  io.enter.ready  := !isUsed(tail.value)
  io.reads.valid  := isUsed(sender.value) && !isSent(sender.value)
  io.reads.bits   := lines(sender.value).line
  io.oldest.valid := isUsed(head.value)
  io.oldest.bits  := lines(head.value)
  for ((entry, isMatch) <- lines.zip(matches)) {
    when(io.joins && isMatch) { entry.buses := entry.buses | io.lookup.buses }
  }
  when(io.oldest.fire) {
    isUsed(head.value) := false.B
    head.advance()
  }
  when(io.reads.fire) {
    isSent(sender.value) := true.B
    sender.advance()
  }
  when(io.enter.fire) {
    isUsed(tail.value) := true.B
    isSent(tail.value) := false.B
    lines(tail.value)  := io.lookup
    tail.advance()
  }
}

/** A position in a ring of `count` entries. */
private final class RingPointer(count: Int) {
  private val index = RegInit(0.U(log2Ceil(count).max(1).W))

  def value: UInt = index

  def advance(): Unit = index := (if (count == 1) 0.U else Mux(index === (count - 1).U, 0.U, index + 1.U))
}
