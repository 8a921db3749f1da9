package colonnade.memory

import chisel3._
import chisel3.util._
import colonnade.common.RoundRobin
import colonnade.config.ColonnadeConfig
import colonnade.formats.RecordFormats

/** A line from DRAM. */
final class ReadLine(config: ColonnadeConfig) extends Bundle {
  val records = Vec(Lines.records, new RecordFormats(config).record)

  /** The read failed; the records count as 0, and the line is not kept. */
  val isError = Bool()
}

/** Ports of [[SharedCache]]. */
final class SharedCacheIO(config: ColonnadeConfig) extends Bundle {

  /** By column; may be withdrawn. */
  val requests = Vec(config.array.columns, Flipped(Decoupled(UInt(Lines.lineBits(config).W))))
  val lines    = Output(new LineBroadcast(config))

  /** Lines to read from DRAM, and the lines that were read, in the same order. A line's records are stable until taken. */
  val reads = Decoupled(UInt(Lines.lineBits(config).W))
  val data  = Flipped(Decoupled(new ReadLine(config)))

  /** Forgets all lines; only while idle. */
  val invalidate = Input(Bool())

  /** No request is looked up, and no line is awaited or announced. */
  val isIdle = Output(Bool())
}

/** One bank of the cache that all columns share, behind the same bank of every [[ColumnCache]].
  *
  * {{{
  * cycle    d−1     d                     d+1        d+2 … d+5            d+3 … d+6   d+4 … d+7
  * request  accept  tags, awaited lines   announced  records read (hit)               records on the bus
  * line             victim                announced  records written
  * }}}
  *
  * A held line is announced to all columns, and every column that awaits it takes it. A line that is already awaited from
  * DRAM needs nothing: its announcement will come, and its column awaits it. So the cache does not remember who asked.
  * Reads from DRAM are announced in their order. They precede requests that hit, which keep their place and are looked up
  * again.
  */
final class SharedCache(config: ColonnadeConfig) extends Module {
  private val cache    = config.columnBvhMemory.cache.get
  private val banks    = config.columnBvhMemory.banks
  private val sets     = cache.sharedSets(banks)
  private val ways     = cache.sharedWays
  private val setBits  = log2Ceil(sets)
  private val wayBits  = log2Ceil(ways)
  private val lineBits = Lines.lineBits(config)
  private val tagBits  = (lineBits - setBits).max(1)

  val io = IO(new SharedCacheIO(config))

  private val tags        = SyncReadMem(sets, Vec(ways, UInt(tagBits.W)))
  private val records     = SyncReadMem(sets * ways * Lines.records, new RecordFormats(config).record)
  private val isValid     = RegInit(VecInit(Seq.fill(sets)(0.U(ways.W))))
  private val replacement = new Replacement(sets, ways)
  private val awaited     = Module(new AwaitedLines(config, cache.sharedMisses / banks))

  private def setOf(line: UInt): UInt = line.pad(setBits + 1)(setBits - 1, 0)
  private def tagOf(line: UInt): UInt = (line >> setBits).asUInt.pad(tagBits)(tagBits - 1, 0)

  // Cycle d − 1: accept a request when the last one leaves; one that stays is looked up again
  private val arbiter   = Module(new RoundRobin(config.array.columns))
  private val isWaiting = RegInit(false.B) // a request is being looked up
  private val leaves    = Wire(Bool())
  private val accepts   = (!isWaiting || leaves) && arbiter.io.requests.orR
  private val line      = Reg(UInt(lineBits.W))
  private val next      = Mux1H(arbiter.io.grant, io.requests.map(_.bits))
  arbiter.io.requests := VecInit(io.requests.map(_.valid)).asUInt
  arbiter.io.isTaken  := accepts
  io.requests.zip(arbiter.io.grant.asBools).foreach { case (request, isGranted) =>
    request.ready := isGranted && (!isWaiting || leaves)
  }
  isWaiting := accepts || (isWaiting && !leaves)
  when(accepts) { line := next }

  // Cycle d: the bus is free every four cycles. A line from DRAM has priority
  private val busy      = RegInit(0.U(2.W))
  private val isFree    = busy === 0.U
  private val isFilling = RegInit(false.B)         // a line from DRAM is being written
  private val fills     = io.data.valid && isFree && !isFilling
  private val isFresh   = RegNext(!fills, false.B) // the tags were read in the cycle before
  private val found     = Wire(Vec(ways, UInt(tagBits.W)))
  private val hitOH     = VecInit(found.zipWithIndex.map { case (tag, way) =>
    isValid(setOf(line))(way) && tag === tagOf(line)
  }).asUInt
  private val isHit    = isWaiting && isFresh && hitOH.orR
  private val isMiss   = isWaiting && isFresh && !hitOH.orR && !awaited.io.isAwaited
  private val delivers = isHit && isFree && !fills
  awaited.io.line        := line
  awaited.io.enter.valid := isMiss
  awaited.io.enter.bits  := line
  leaves := isWaiting && isFresh && (delivers || (!hitOH.orR && (awaited.io.isAwaited || awaited.io.enter.ready)))
  when(fills || delivers) { busy := (Lines.records - 1).U }.elsewhen(!isFree) { busy := busy - 1.U }
  isFilling := fills || (isFilling && !io.data.fire)

  // A line from DRAM replaces another one
  private val filled   = awaited.io.oldest.bits
  private val freeWays = ~isValid(setOf(filled))
  private val victim   = Mux(freeWays.orR, PriorityEncoder(freeWays), replacement.victim(setOf(filled)))
  private val keeps    = fills && !io.data.bits.isError
  private val hitWay   = OHToUInt(hitOH)
  awaited.io.oldest.ready := fills
  when(delivers) { replacement.use(setOf(line), hitWay) }
  when(fills) {
    val rest = isValid(setOf(filled)) & ~UIntToOH(victim, ways)
    isValid(setOf(filled)) := Mux(keeps, rest | UIntToOH(victim, ways), rest)
    replacement.use(setOf(filled), victim)
  }
  found := tags.readWrite(
    Mux(fills, setOf(filled), setOf(Mux(accepts, next, line))),
    VecInit(Seq.fill(ways)(tagOf(filled))),
    UIntToOH(victim, ways).asBools,
    fills || accepts || isWaiting,
    fills
  )
  assert(!fills || awaited.io.oldest.valid, "a line that was not read")

  // Cycle d + 1: announce
  private val starts = fills || delivers
  io.lines.announced.valid := RegNext(starts, false.B)
  io.lines.announced.bits  := RegEnable(Mux(fills, filled, line), starts)

  // Cycles d + 2 to d + 5: read the records, or write those from DRAM; a cycle later they go to the bus
  private val place = RegNext(RegEnable(
    Mux(fills, setOf(filled) ## victim(wayBits - 1, 0), setOf(line) ## hitWay(wayBits - 1, 0)),
    starts
  ))
  private val isFill   = RegNext(RegEnable(fills, starts))
  private val isKept   = RegNext(RegEnable(keeps, starts))
  private val begins   = RegNext(RegNext(starts, false.B), false.B)
  private val word     = RegInit(0.U(Lines.wordBits.W))
  private val isActive = begins || word =/= 0.U
  when(isActive) { word := word + 1.U }
  private val arriving = Mux(io.data.bits.isError, 0.U, io.data.bits.records(word))
  private val held     = records.readWrite(place ## word, arriving, isActive && (!isFill || isKept), isFill)
  private val record   = RegNext(Mux(RegNext(isFill), RegEnable(arriving, isActive), held))
  io.lines.record := record
  io.data.ready   := isActive && isFill && word.andR

  io.reads :<>= awaited.io.reads
  when(io.invalidate) { isValid.foreach(_ := 0.U) }
  io.isIdle := !(isWaiting || awaited.io.oldest.valid || !isFree || isFilling || isActive || RegNext(starts, false.B))
  assert(!(io.invalidate && !io.isIdle), "lines are forgotten while some are read")
}

/** Ports of [[AwaitedLines]]. */
private final class AwaitedLinesIO(lineBits: Int) extends Bundle {

  /** Whether this line is awaited. */
  val line      = Input(UInt(lineBits.W))
  val isAwaited = Output(Bool())

  val enter  = Flipped(Decoupled(UInt(lineBits.W)))
  val reads  = Decoupled(UInt(lineBits.W))
  val oldest = Decoupled(UInt(lineBits.W))
}

/** The lines of a bank that are awaited from DRAM, in order. */
private final class AwaitedLines(config: ColonnadeConfig, count: Int) extends Module {
  private val lineBits = Lines.lineBits(config)

  val io = IO(new AwaitedLinesIO(lineBits))

  private val lines  = Reg(Vec(count, UInt(lineBits.W)))
  private val isUsed = RegInit(VecInit(Seq.fill(count)(false.B)))
  private val isSent = Reg(Vec(count, Bool()))
  private val tail   = new RingPointer(count)
  private val sender = new RingPointer(count)
  private val head   = new RingPointer(count)

  io.isAwaited    := lines.zip(isUsed).map { case (line, used) => used && line === io.line }.reduce(_ || _)
  io.enter.ready  := !isUsed(tail.value)
  io.reads.valid  := isUsed(sender.value) && !isSent(sender.value)
  io.reads.bits   := lines(sender.value)
  io.oldest.valid := isUsed(head.value)
  io.oldest.bits  := lines(head.value)
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
    lines(tail.value)  := io.enter.bits
    tail.advance()
  }
}

/** A position in a ring of `count` entries. */
private final class RingPointer(count: Int) {
  private val index = RegInit(0.U(log2Ceil(count).max(1).W))

  def value: UInt = index

  def advance(): Unit = index := (if (count == 1) 0.U else Mux(index === (count - 1).U, 0.U, index + 1.U))
}
