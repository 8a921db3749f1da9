package colonnade.memory

import chisel3._
import chisel3.util._
import colonnade.common.TimingSlice
import colonnade.config.ColonnadeConfig

final class ColumnCacheIO(config: ColonnadeConfig) extends Bundle {
  val port = Flipped(new BankPort(config))

  /** A line that this bank awaits; may be withdrawn when another column's request has brought it. */
  val request = Decoupled(UInt(Lines.lineBits(config).W))
  val lines   = Input(new LineBroadcast(config))

  val invalidate = Input(Bool()) // forgets all lines; only while idle

  /** With parity: a record that was answered or filled in the cycle before has a wrong one. */
  val error = Option.when(Lines.hasParity(config))(Output(Bool()))

  val isIdle = Output(Bool()) // no request is in flight, and no line is awaited
}

/** One bank of a column's cache; docs/scene-cache.md has a table of its cycles.
  *
  * A request that misses is answered "later", and its line is entered among the awaited ones, once. So hits pass
  * misses. A record follows a "later" for certain: the line is awaited before the answer, until it is announced. While
  * records of a line arrive, no request is accepted: they use the same memory and the same broadcast. With parity, a
  * record with a wrong one becomes zeros: a node without children, or a leaf without triangles.
  */
final class ColumnCache(config: ColonnadeConfig) extends Module {
  private val cache    = config.columnBvhMemory.cache.get
  private val banks    = config.columnBvhMemory.banks
  private val sets     = cache.sets(banks)
  private val ways     = cache.ways
  private val lineBits = Lines.lineBits(config)

  val io = IO(new ColumnCacheIO(config))

  private val slice   = TimingSlice.extra(config)
  private val tags    = new TagStore(sets, ways, lineBits, inMemory = slice.isEnabled)
  private val records = SyncReadMem(sets * ways * Lines.records, Lines.stored(config))

  private final class AwaitedLine {
    val isUsed                = RegInit(false.B)
    val isRequested           = Reg(Bool())
    val line                  = Reg(UInt(lineBits.W))
    def is(other: UInt): Bool = isUsed && line === other
  }
  private val awaited = Seq.fill(cache.misses / banks)(new AwaitedLine)

  private def lineOf(address: UInt): UInt = (address >> Lines.wordBits).asUInt

  /** A record without its parity. */
  private def checked(stored: UInt): UInt =
    if (Lines.hasParity(config)) Mux(stored.xorR, 0.U, stored.tail(1)) else stored

  // Cycle a: an announced line is taken if it is awaited
  private val takes         = io.lines.announced.valid && awaited.map(_.is(io.lines.announced.bits)).reduce(_ || _)
  private val taken         = RegNext(takes, false.B)
  private val line          = RegEnable(io.lines.announced.bits, takes)
  private val blocked       = RegInit(0.U(3.W)) // cycles without requests
  private val blockedCycles = LineBroadcast.latency + Lines.records - 2
  when(takes) { blocked := blockedCycles.U }.elsewhen(blocked =/= 0.U) { blocked := blocked - 1.U }

  // Cycle c: accept a request, if its line could be awaited even though the request before it misses
  private val request   = io.port.request
  private val accepted  = RegNext(request.fire, false.B)
  private val address   = RegEnable(request.bits, request.fire)
  private val freeCount = PopCount(awaited.map(!_.isUsed))
  // An extra slice lies between the comparison and the entry of a line that misses
  private val enters    = WireInit(false.B)
  private val missed    = slice(lineOf(address))
  private val isMissed  = if (slice.isEnabled) enters else false.B // in the cycle before
  private val blocksNow =
    if (slice.isEnabled) io.lines.announced.valid else false.B // the answer would meet the first record
  request.ready := blocked === 0.U && !blocksNow && freeCount > accepted +& isMissed

  // Cycle c + 1: compare. A line is never both held and awaited
  private val hitOH  = tags.hitOH(lineOf(address))
  private val isHit  = accepted && hitOH.orR
  private val awaits = awaited.map(_.is(lineOf(address))).reduce(_ || _) || (isMissed && missed === lineOf(address))
  private val hitWay = OHToUInt(hitOH)
  private val freeOH = PriorityEncoderOH(awaited.map(!_.isUsed))
  private val isMiss = accepted && !hitOH.orR
  when(slice.flag(isHit)) { tags.use(slice(lineOf(address)), slice(hitWay)) }
  enters := slice.flag(isMiss && !awaits)
  for ((entry, isFree) <- awaited.zip(freeOH)) when(enters && isFree) {
    entry.isUsed      := true.B
    entry.isRequested := false.B
    entry.line        := missed
  }
  assert(!(isHit && awaits), "a line is held and awaited")

  // Cycle a + 1: the line replaces another one, and is no longer awaited. With an extra slice the other one is found in
  // this cycle, and replaced in the next one
  private val victim   = slice(tags.victim(line))
  private val replaces = slice.flag(taken)
  when(replaces) {
    tags.replace(line, victim, isKept = true.B)
    awaited.foreach(entry => when(entry.is(line)) { entry.isUsed := false.B })
  }
  tags.access(Mux(replaces, line, lineOf(request.bits)), victim, request.fire, replaces)

  // Cycles a + 3 and a + 4: its records
  private val place      = RegEnable(tags.place(line, victim), replaces)
  private val placeNow   = ShiftRegister(place, 1 - slice.cycles) // valid from a + 3
  private val lineNow    = RegNext(RegEnable(line, taken))
  private val firstComes = RegNext(RegNext(taken, false.B), false.B)
  private val word       = RegInit(0.U(Lines.wordBits.W))
  private val fills      = firstComes || word =/= 0.U
  when(fills) { word := word + 1.U }

  // An extra slice lies behind the comparison: then answers are a cycle later
  private val reads   = slice.flag(isHit)
  private val readNow = tags.place(slice(lineOf(address)), slice(hitWay)) ## slice(address(Lines.wordBits - 1, 0))
  private val data    = records.readWrite(Mux(fills, placeNow ## word, readNow), io.lines.record, fills || reads, fills)
  io.port.fill.get.valid        := fills
  io.port.fill.get.bits.address := lineNow ## word
  io.port.fill.get.bits.record  := checked(io.lines.record)

  // Cycle c + 2: answer
  io.port.response.valid            := RegNext(slice.flag(accepted), false.B)
  io.port.response.bits.record      := checked(data)
  io.port.response.bits.isLater.get := RegNext(slice.flag(isMiss), false.B)

  for (error <- io.error)
    error := RegNext((fills && io.lines.record.xorR) || (RegNext(reads, false.B) && data.xorR), false.B)

  // Request awaited lines, one after the other; an extra slice lies behind the choice
  private def isOpen(entry: AwaitedLine): Bool = entry.isUsed && !entry.isRequested
  private val nextOH                           = PriorityEncoderOH(awaited.map(isOpen))
  private val chosenOH                         = slice(VecInit(nextOH))
  io.request.valid := chosenOH.zip(awaited).map { case (is, entry) => is && isOpen(entry) }.reduce(_ || _)
  io.request.bits := slice(Mux1H(nextOH, awaited.map(_.line)))
  when(io.request.fire) {
    awaited.zip(chosenOH).foreach { case (entry, isNext) => when(isNext) { entry.isRequested := true.B } }
  }

  when(io.invalidate) { tags.clear() }
  io.isIdle := !(accepted || slice.flag(accepted) || io.port.response.valid || fills || blocked =/= 0.U ||
    awaited.map(_.isUsed).reduce(_ || _))
  assert(!(io.invalidate && !io.isIdle), "lines are forgotten while some are awaited")
}
