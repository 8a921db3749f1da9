package colonnade.memory

import chisel3._
import chisel3.util._
import colonnade.common.{RoundRobin, TimingSlice}
import colonnade.config.ColonnadeConfig

/** A line from DRAM. */
final class ReadLine(config: ColonnadeConfig) extends Bundle {
  val records = Vec(Lines.records, Lines.stored(config))

  /** The read failed; the records count as 0, and the line is not kept. */
  val isError = Bool()
}

final class SharedCacheIO(config: ColonnadeConfig) extends Bundle {

  /** By column, may be withdrawn; by bus. */
  val requests = Vec(config.array.columns, Flipped(Decoupled(UInt(Lines.lineBits(config).W))))
  val lines    = Output(Vec(SharedCache.buses(config), new LineBroadcast(config)))

  /** Lines to read from DRAM, and the lines that were read, in the same order. */
  val reads = Decoupled(UInt(Lines.lineBits(config).W))
  val data  = Flipped(Decoupled(new ReadLine(config)))

  val invalidate = Input(Bool()) // forgets all lines; only while idle

  /** No request is looked up, and no line is read or announced. */
  val isIdle = Output(Bool())
}

/** One bank of the cache that all columns share, behind the same bank of every [[ColumnCache]]: docs/scene-cache.md.
  * {{{ cycle    d−1     d                     d+1                d+2             d+4, d+5 request  accept  tags,
  * awaited lines   announced          line read       records on the bus line             victim
  * announced, taken   line written    records on the bus }}} While less than half of the entries of lines to read are
  * used, a missing line's buddy is also read, unless it is held. Reads from DRAM are announced in their order. They
  * precede requests that hit, which keep their place and are looked up again.
  */
final class SharedCache(config: ColonnadeConfig) extends Module {
  private val cache    = config.columnBvhMemory.cache.get
  private val banks    = config.columnBvhMemory.banks
  private val buses    = SharedCache.buses(config)
  private val sets     = cache.sharedSets(banks)
  private val ways     = cache.sharedWays
  private val lineBits = Lines.lineBits(config)

  val io = IO(new SharedCacheIO(config))

  private val slice   = TimingSlice.extra(config)
  private val tags    = new TagStore(sets, ways, lineBits, inMemory = slice.isEnabled)
  private val lines   = SyncReadMem(sets * ways, Vec(Lines.records, Lines.stored(config)))
  private val awaited = Module(new AwaitedLines(config, cache.sharedMisses / banks))

  /** By bus: whether a condition holds for any of its columns. */
  private def byBus(ofColumns: Seq[Bool]): Seq[Bool] = (0 until buses).map { bus =>
    ofColumns.zipWithIndex.collect { case (holds, column) if SharedCache.busOf(config, column) == bus => holds }
      .reduce(_ || _)
  }

  // Each bus is free every two cycles
  private val starts = Wire(UInt(buses.W)) // announcements
  private val busy   = starts.asBools.map { isStarting =>
    val cycles = RegInit(0.U(log2Ceil(Lines.records).W))
    when(isStarting) { cycles := (Lines.records - 1).U }.elsewhen(cycles =/= 0.U) { cycles := cycles - 1.U }
    cycles
  }
  private val free = VecInit(busy.map(_ === 0.U)).asUInt

  // A line from DRAM has priority on its buses
  private val isFilling = RegInit(false.B) // it is being taken
  private val filled    = awaited.io.oldest.bits
  private val comes     = io.data.valid && !isFilling
  private val fills     = comes && (filled.buses & ~free) === 0.U
  private val usable    = free & ~Mux(comes, filled.buses, 0.U)

  // Cycle d − 1: accept a request when the last one leaves and its own bus will be free; one that stays is looked up
  // again
  private val arbiter    = Module(new RoundRobin(config.array.columns))
  private val isWaiting  = RegInit(false.B) // a request is being looked up
  private val leaves     = Wire(Bool())
  private val asked      = Reg(new AwaitedLine(config))
  private val line       = asked.line
  private val willBeFree = busy.zipWithIndex.map { case (cycles, bus) =>
    !(comes && filled.buses(bus)) && (cycles === 1.U || (cycles === 0.U && !(isWaiting && asked.buses(bus))))
  }
  private val eligible = io.requests.zipWithIndex.map { case (request, column) =>
    request.valid && willBeFree(SharedCache.busOf(config, column))
  }
  // With extra slices a request enters in the cycle after the last one has left
  private val isVacant   = if (slice.isEnabled) !isWaiting else !isWaiting || leaves
  private val buddy      = RegInit(0.U.asTypeOf(Valid(UInt(lineBits.W)))) // to be looked up when no request is
  private val isBuddy    = RegInit(false.B)                               // it is what is looked up
  private val hasRequest = arbiter.io.requests.orR
  private val accepts    = isVacant && (hasRequest || buddy.valid)
  private val next       = Mux(hasRequest, Mux1H(arbiter.io.grant, io.requests.map(_.bits)), buddy.bits)
  arbiter.io.requests := VecInit(eligible).asUInt
  arbiter.io.isTaken  := isVacant && hasRequest
  io.requests.zip(arbiter.io.grant.asBools).foreach { case (request, isGranted) =>
    request.ready := isGranted && isVacant
  }
  isWaiting := accepts || (isWaiting && !leaves)
  when(accepts) {
    asked.line  := next
    asked.buses := Mux(hasRequest, VecInit(byBus(arbiter.io.grant.asBools)).asUInt, 0.U)
    isBuddy     := !hasRequest
  }

  // Cycle d: compare
  private val isFresh    = RegNext(!fills, false.B) // the tags were read in the cycle before
  private val hitOH      = tags.hitOH(line)
  private val isLookedUp = isWaiting && isFresh && !fills
  private val isHit      = isLookedUp && hitOH.orR
  private val isPending  = awaited.io.isAwaited
  private val isMiss     = isLookedUp && !hitOH.orR && !isPending
  private val joins      = isLookedUp && !hitOH.orR && isPending
  private val delivers   = isHit && (asked.buses & usable).orR
  awaited.io.lookup      := asked
  awaited.io.joins       := joins
  awaited.io.enter.valid := isMiss
  private val enters = awaited.io.enter.fire
  leaves := delivers || joins || enters || (isLookedUp && isBuddy)
  when(accepts && !hasRequest)(buddy.valid := false.B)
  when(enters && !isBuddy) {
    buddy.valid := !awaited.io.isBusy
    buddy.bits  := Lines.buddy(line)
  }
  isFilling := fills

  // Announce on the buses that must, and on idle ones
  private val announced = Mux(fills, filled.line, line)
  private val isOther   = VecInit(byBus(io.requests.map(request => request.valid && request.bits =/= announced))).asUInt
  private val joining   = usable & ~isOther
  private val targets   = Mux(fills, filled.buses, asked.buses)
  starts := Mux((fills || delivers) && targets.orR, targets | joining, 0.U)

  // A line from DRAM replaces another one
  // With an extra slice it is found in the cycle before: then the line is the oldest one already
  private val victim = slice(tags.victim(filled.line))
  private val keeps  = fills && !io.data.bits.isError
  private val hitWay = OHToUInt(hitOH)
  awaited.io.oldest.ready := fills
  when(delivers) { tags.use(line, hitWay) }
  when(fills) { tags.replace(filled.line, victim, keeps) }
  tags.access(Mux(fills, filled.line, Mux(accepts, next, line)), victim, accepts || isWaiting, fills)
  assert(!fills || awaited.io.oldest.valid, "a line that was not read")

  // Cycle d + 1: announce
  private val isAnnounced = starts.asBools.map(RegNext(_, false.B))
  private val lineNow     = RegNext(announced)
  for ((port, isOn) <- io.lines.zip(isAnnounced)) {
    port.announced.valid := isOn
    port.announced.bits  := lineNow
  }

  // Cycle d + 2: read the line, or write that from DRAM, which is held until the next one is taken
  io.data.ready := isFilling
  private val incoming = RegEnable(io.data.bits, isFilling)
  private val place    = ShiftRegister(Mux(fills, tags.place(filled.line, victim), tags.place(line, hitWay)), 2)
  private val isFill   = RegNext(RegNext(fills, false.B), false.B)
  private val isKept   = RegNext(RegNext(keeps, false.B), false.B)
  private val isRead   = RegNext(RegNext(delivers, false.B), false.B)
  private val held     = lines.readWrite(place, incoming.records, isRead || isKept, isKept)
  private val isTaken  = RegNext(isFill, false.B)

  // Cycles d + 4 and d + 5: the records on the bus; records of a failed read become zeros, and nobody reads them later
  private val ready = VecInit(held.zip(incoming.records).map { case (record, other) =>
    Mux(isTaken, other, record)
  })
  for ((port, isOn) <- io.lines.zip(isAnnounced)) {
    val begins = ShiftRegister(isOn, 2, false.B, true.B)
    val rest   = Reg(Vec(Lines.records, Lines.stored(config)))
    rest        := Mux(begins, ready, VecInit(rest.tail :+ rest.last))
    port.record := Mux(RegEnable(isTaken && incoming.isError, begins), 0.U.asTypeOf(rest.head), rest.head)
  }

  io.reads :<>= awaited.io.reads
  when(io.invalidate) { tags.clear() }
  io.isIdle := !(isWaiting || buddy.valid || awaited.io.oldest.valid || !free.andR || isFilling)
  assert(!(io.invalidate && !io.isIdle), "lines are forgotten while some are read")
}

object SharedCache {

  /** Columns that one bus serves: more of them share lines, fewer of them wait less for the bus. */
  private val columnsPerBus = 4

  /** Buses from a bank of the shared cache to the columns; the one that serves a column. */
  def buses(config: ColonnadeConfig): Int              = (config.array.columns + columnsPerBus - 1) / columnsPerBus
  def busOf(config: ColonnadeConfig, column: Int): Int = column / columnsPerBus
}
