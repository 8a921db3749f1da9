package colonnade.unit

import chisel3._
import chisel3.util.{
  log2Ceil,
  Mux1H,
  MuxLookup,
  OHToUInt,
  Pipe,
  PopCount,
  PriorityEncoder,
  PriorityEncoderOH,
  RegEnable,
  Valid
}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Banks, RecordBroadcast, RecordFormats}

/** Fetches records for contexts: a small file of fill buffers with miss handling and snooping.
  *
  * A buffer is reserved before a read is requested, so a broadcast never stalls. With snooping, every waiting context
  * takes a matching record, from a broadcast or from a buffer, whichever row requested it. A buffer also captures any
  * broadcast that a context waits for, and keeps its record until another read needs the buffer. Without snooping, a
  * context takes only the response to its own read.
  *
  * With a cache, a read may be answered "later". The contexts that wait for this record then sleep, and their buffer is
  * free again. The record's broadcast wakes them. If no buffer is available for it, they ask once more, and this time
  * keep their buffer until the record comes, so that every context gets its record in the end.
  *
  * Arbitration is pipelined. The winner (`grantNext`) is chosen one cycle early and addresses the tables of the context;
  * `response` follows with the record. A unit therefore says one cycle ahead that it accepts a record (`readyNext`).
  * Triangles have priority, because the triangle unit starts only in every fourth cycle. Attributes are second and nodes
  * last.
  *
  * A response comes at the earliest two cycles after the record's broadcast, or two cycles after the request if a buffer
  * holds the record.
  */
final class RecordFetch(config: ColonnadeConfig) extends Module {
  private val contexts = config.array.contexts
  private val snooping = config.columnBvhMemory.snooping.B
  private val hasCache = config.columnBvhMemory.cache.nonEmpty

  val io = IO(new RecordFetchIO(config))

  private val ports = io.fetches.size

  private object BufferState extends ChiselEnum {
    val empty, reserved, full = Value
  }
  private final class RecordBuffer {
    val state   = RegInit(BufferState.empty)
    val address = Reg(UInt(RecordFormats.addressBits(config).W))
    val record  = Reg(new RecordFormats(config).record)

    /** Stays reserved when the record comes later. */
    val isKept = if (hasCache) Some(Reg(Bool())) else None
  }
  private final class ContextFetch {
    val isPending = RegInit(false.B)

    /** The address is illegal: the fetch waits to report its error and takes no record, whatever the buffers hold. */
    val isIllegal = RegInit(false.B)
    val hasRecord = RegInit(false.B)

    /** The context has requested its own read, which fills `buffer`. */
    val isIssued = Reg(Bool())

    /** A reserved buffer, of any context, awaits the record. */
    val isExpected = Reg(Bool())

    /** By port: the fetch has come in the cycle before. */
    val cameFrom = RegInit(VecInit.fill(ports)(false.B))
    val kind     = Reg(RecordKind())
    val address  = Reg(UInt(RecordFormats.addressBits(config).W))
    val buffer   = Reg(UInt(log2Ceil(config.columnBvhMemory.recordBuffers.max(2)).W))

    /** The record comes later, without a request. */
    val sleeps = if (hasCache) Some(RegInit(false.B)) else None

    /** The context has missed the broadcast it slept for. */
    val insists = if (hasCache) Some(Reg(Bool())) else None
  }

  /** With short paths broadcasts are registered, and compared in the cycle before. */
  private val shortPaths = config.units.extraSlices
  private val broadcasts = io.broadcasts.map { broadcast =>
    if (shortPaths) Pipe(broadcast.valid, broadcast.bits) else broadcast
  }

  /** By bank: its broadcast has this address, which with short paths is that of the cycle before. Only the bank of the
    * address can have it.
    */
  private def comes(address: UInt): Seq[Bool] = {
    val banks     = io.broadcasts.indices.map(Banks.isIn(config, address, _))
    val inBank    = Mux1H(banks, io.broadcasts.map(broadcast => Banks.addressIn(config, broadcast.bits.address)))
    val isAddress = inBank === Banks.addressIn(config, address)
    banks.map(_ && isAddress).map(is => if (shortPaths) RegNext(is) else is)
  }

  /** A broadcast that is a record. */
  private def isRecord(broadcast: Valid[RecordBroadcast]): Bool =
    broadcast.valid && !broadcast.bits.isLater.getOrElse(false.B)

  private val buffers = Seq.fill(config.columnBvhMemory.recordBuffers)(new RecordBuffer)
  private val fetches = Seq.fill(contexts)(new ContextFetch)

  /** Sections are consecutive, and the address of a face is never below the attribute section. */
  private def isInSection(address: UInt, kind: RecordKind.Type): Bool = {
    val isNode = address < io.scene.triangleBase
    MuxLookup(kind, address < io.scene.recordCount)(
      Seq(RecordKind.node -> isNode, RecordKind.triangles -> (!isNode && address < io.scene.attributeBase))
    )
  }

  /** Buffer `index` receives, or has received, the context's own read. */
  private def isOwnRead(fetch: ContextFetch, index: Int): Bool = fetch.isIssued && fetch.buffer === index.U

  // Lookup: a new fetch compares with all buffers. Later only a fill or a new reservation changes what it finds.
  // With short paths the result is used two cycles later, and a buffer that gets another address meanwhile does not match.
  // By port and buffer, then by context and buffer
  private val newAddresses = io.fetches.map(port => RegEnable(port.bits.address, port.valid))
  private val isWritten    = if (shortPaths) Some(Wire(Vec(buffers.size, Bool()))) else None
  private val portMatches  = newAddresses.map { address =>
    buffers.zipWithIndex.map { case (buffer, index) =>
      val isMatch = buffer.address === address
      isWritten.fold(isMatch)(written => RegNext(isMatch && !written(index)))
    }
  }
  private val newMatches = fetches.map { fetch =>
    val from = if (shortPaths) RegNext(fetch.cameFrom) else fetch.cameFrom
    buffers.indices.map { index =>
      val isMatch = Mux1H(from, portMatches.map(_(index)))
      isWritten.fold(isMatch)(written => RegNext(isMatch && !written(index))) && fetch.isPending && snooping
    }
  }
  private val bufferHits = newMatches.map(_.zip(buffers).map { case (isMatch, buffer) =>
    isMatch && buffer.state === BufferState.full
  })

  // A full buffer may be replaced when no context uses its record
  private val isAvailable = buffers.zipWithIndex.map { case (buffer, index) =>
    val isUsed = fetches.zip(bufferHits).map { case (fetch, hits) =>
      hits(index) || (fetch.hasRecord && fetch.buffer === index.U)
    }
    buffer.state === BufferState.empty || (buffer.state === BufferState.full && !isUsed.reduce(_ || _))
  }

  // Fill: a broadcast goes to its reserved buffer, else (snooping) to an available one if a context waits for it.
  // `waiters` is by broadcast and context, `bufferFills` by broadcast and buffer
  // A fetch that is new misses a broadcast that came together with it
  private val waiters = fetches.map { fetch =>
    val waits = if (shortPaths) fetch.isPending && !fetch.cameFrom.reduce(_ || _) else fetch.isPending
    comes(fetch.address).map(_ && waits)
  }.transpose
  private val awaited =
    buffers.map(buffer => comes(buffer.address).map(_ && buffer.state === BufferState.reserved)).transpose
  private val (availableAfterFill, bufferFills) =
    broadcasts.zip(waiters.zip(awaited)).foldLeft((isAvailable, Seq.empty[Seq[Bool]])) {
      case ((available, fills), (broadcast, (waits, awaits))) =>
        val isReserved = awaits.map(_ && (snooping || broadcast.bits.row === io.row))
        val isMissing  = waits.zip(bufferHits).map { case (waits, hits) => waits && !hits.reduce(_ || _) }
        val isSnooped  = snooping && !isReserved.reduce(_ || _) && isMissing.reduce(_ || _)
        val allocOH    = PriorityEncoderOH(available).map(_ && isSnooped && isRecord(broadcast))
        val reservedOH = PriorityEncoderOH(isReserved).map(_ && isRecord(broadcast))
        val fillOH     = allocOH.zip(reservedOH).map { case (allocated, reserved) => allocated || reserved }
        (available.zip(allocOH).map { case (free, allocated) => free && !allocated }, fills :+ fillOH)
    }

  for ((buffer, fills) <- buffers.zip(bufferFills.transpose)) {
    val broadcast = Mux1H(fills, broadcasts.map(_.bits))
    when(fills.reduce(_ || _)) {
      buffer.state   := BufferState.full
      buffer.address := broadcast.address
      buffer.record  := broadcast.record
    }
  }

  // A context gets the record that a buffer holds, or receives in this cycle. By context and buffer
  private val contextFills = fetches.zipWithIndex.map { case (fetch, context) =>
    buffers.indices.map { index =>
      val arrives = bufferFills.zip(waiters).map { case (fillOH, waits) =>
        fillOH(index) && Mux(snooping, waits(context), fetch.isPending && isOwnRead(fetch, index))
      }
      bufferHits(context)(index) || arrives.reduce(_ || _)
    }
  }
  fetches.zip(contextFills).foreach { case (fetch, fills) =>
    when(fills.reduce(_ || _)) {
      fetch.isPending := false.B
      fetch.hasRecord := true.B
      fetch.buffer    := PriorityEncoder(fills)
    }
  }
  // With short paths they are counted a cycle later
  private val snoopHits = VecInit(fetches.zip(contextFills).map { case (fetch, fills) =>
    fills.reduce(_ || _) && !fetch.isIssued
  })
  io.snoopHits := PopCount(if (shortPaths) RegNext(snoopHits) else snoopHits)

  // Miss: request the record of the first context whose record no buffer holds or awaits
  private val isExpected = fetches.zip(newMatches).map { case (fetch, matches) =>
    val isNow = buffers.zip(matches).map { case (buffer, isMatch) => isMatch && buffer.state =/= BufferState.empty }
    Mux(snooping, fetch.isExpected || isNow.reduce(_ || _), fetch.isIssued)
  }
  private def misses(fetch: ContextFetch, isExpected: Bool): Bool =
    fetch.isPending && !isExpected && !fetch.sleeps.getOrElse(false.B)
  private val nextMissOH = PriorityEncoderOH(fetches.zip(isExpected).map { case (fetch, isExpected) =>
    val isLookedUp =
      if (shortPaths) !(fetch.cameFrom.reduce(_ || _) || RegNext(fetch.cameFrom.reduce(_ || _), false.B)) else true.B
    isLookedUp && misses(fetch, isExpected)
  })

  // With short paths the context is chosen in the cycle before
  private val missOH =
    if (shortPaths) fetches.zip(nextMissOH).map { case (fetch, isNext) =>
      RegNext(isNext, false.B) && misses(fetch, Mux(snooping, fetch.isExpected, fetch.isIssued))
    }
    else nextMissOH
  private val hasMiss     = missOH.reduce(_ || _)
  private val nextAddress = Mux1H(nextMissOH, fetches.map(_.address))
  private val address     = if (shortPaths) RegNext(nextAddress) else nextAddress
  private val allocOH     = PriorityEncoderOH(if (shortPaths) isAvailable else availableAfterFill)

  // A record that arrives in this cycle needs no request; with short paths none is sent while any arrives
  private val isBlocked =
    if (shortPaths) (broadcasts ++ io.broadcasts).map(_.valid).reduce(_ || _)
    else snooping && broadcasts.zip(
      comes(address)
    ).map { case (broadcast, comes) => broadcast.valid && comes }.reduce(_ || _)
  io.requests.valid        := hasMiss && allocOH.reduce(_ || _) && !isBlocked
  io.requests.bits.address := address
  private val isAwaited = buffers.map(buffer => buffer.state === BufferState.reserved && buffer.address === address)
  assert(!(snooping && io.requests.valid && isAwaited.reduce(_ || _)), "a record is requested twice")
  fetches.zip(isExpected).foreach { case (fetch, isExpected) => fetch.isExpected := isExpected }
  when(io.requests.fire) {
    fetches.foreach(fetch => when(fetch.address === address) { fetch.isExpected := true.B })
    buffers.zip(allocOH).foreach { case (buffer, isAllocated) =>
      when(isAllocated) {
        buffer.state   := BufferState.reserved
        buffer.address := address
        buffer.isKept.foreach(_ := Mux1H(missOH, fetches.flatMap(_.insists)))
      }
    }
    fetches.zip(missOH).foreach { case (fetch, isMiss) =>
      when(isMiss) {
        fetch.isIssued := true.B
        fetch.buffer   := PriorityEncoder(allocOH)
      }
    }
  }

  for ((written, (fills, isAllocated)) <- isWritten.toSeq.flatMap(_.zip(bufferFills.transpose.zip(allocOH))))
    written := fills.reduce(_ || _) || (io.requests.fire && isAllocated)

  // A record that comes later frees its buffer, and its contexts sleep until it comes
  for {
    (broadcast, (waits, awaits)) <- broadcasts.zip(waiters.zip(awaited))
    isLater                      <- broadcast.bits.isLater
  } {
    val isKept = buffers.zip(awaits).map { case (buffer, awaits) => awaits && buffer.isKept.get }.reduce(_ || _)
    when(broadcast.valid && isLater) {
      buffers.zip(awaits).foreach { case (buffer, awaits) =>
        when(awaits && !buffer.isKept.get) { buffer.state := BufferState.empty }
      }
    }
    for (((fetch, waits), fills) <- fetches.zip(waits).zip(contextFills)) {
      when(broadcast.valid && waits && isLater && !isKept) {
        fetch.sleeps.foreach(_ := true.B)
        fetch.isExpected := false.B
      }
      when(broadcast.valid && waits && !isLater && !fills.reduce(_ || _)) {
        fetch.sleeps.foreach(_ := false.B)
        fetch.insists.foreach(_ := true.B)
      }
    }
  }

  // Report illegal addresses
  private val illegalOH = PriorityEncoderOH(fetches.map(_.isIllegal))
  io.error.valid        := illegalOH.reduce(_ || _)
  io.error.bits.context := OHToUInt(illegalOH)
  io.error.bits.kind    := RecordKind.safe(Mux1H(illegalOH, fetches.map(_.kind.asUInt)))._1
  fetches.zip(illegalOH).foreach { case (fetch, isReported) => when(isReported) { fetch.isIllegal := false.B } }

  // Grant: the first ready context of each kind, then the kind with the highest priority whose unit will be ready.
  // The buffer may be replaced in the cycle of the response, because the record leaves it in that cycle
  // With short paths a context that finds its record in a buffer is ready a cycle later
  private val isReady = fetches.zip(bufferHits).map { case (fetch, hits) =>
    if (shortPaths) fetch.hasRecord else fetch.hasRecord || hits.reduce(_ || _)
  }
  private val firstOfKind = RecordKind.all.map { kind =>
    PriorityEncoderOH(fetches.zip(isReady).map { case (fetch, isReady) => isReady && fetch.kind === kind })
  }
  private val grantKindOH = {
    val isRequested = firstOfKind.zip(io.readyNext).map { case (firstOH, ready) => firstOH.reduce(_ || _) && ready }
    PriorityEncoderOH(RecordFetch.priority.map(isRequested(_)))
      .zip(RecordFetch.priority)
      .sortBy { case (_, kind) => kind }
      .map { case (isGranted, _) => isGranted }
  }
  private val grantOH =
    firstOfKind.transpose.map(_.zip(grantKindOH).map { case (first, kind) => first && kind }.reduce(_ || _))
  private val grantBufferOH = buffers.indices.map { index =>
    fetches.zip(bufferHits).zip(grantOH).map { case ((fetch, hits), isGranted) =>
      val isHeld = fetch.buffer === index.U
      isGranted && (if (shortPaths) isHeld else Mux(fetch.hasRecord, isHeld, PriorityEncoderOH(hits)(index)))
    }.reduce(_ || _)
  }
  io.grantNext.valid := grantKindOH.reduce(_ || _)
  io.grantNext.bits  := OHToUInt(grantOH)
  io.grantsNodeNext  := grantKindOH(RecordKind.node.litValue.toInt)
  fetches.zip(grantOH).foreach { case (fetch, isGranted) => when(isGranted) { fetch.hasRecord := false.B } }

  // Response
  private val responseBufferOH = RegEnable(VecInit(grantBufferOH), io.grantNext.valid)
  io.response.valid        := RegNext(io.grantNext.valid, false.B)
  io.response.bits.context := RegEnable(io.grantNext.bits, io.grantNext.valid)
  io.response.bits.kind    := RecordKind.safe(RegEnable(OHToUInt(grantKindOH), io.grantNext.valid))._1
  io.response.bits.address := Mux1H(responseBufferOH, buffers.map(_.address))
  io.response.bits.record  := Mux1H(responseBufferOH, buffers.map(_.record))

  // New fetches
  for {
    (port, number) <- io.fetches.zipWithIndex
    isLegal = isInSection(port.bits.address, port.bits.kind)
    (fetch, context) <- fetches.zipWithIndex
  } {
    val isNew = port.valid && port.bits.context === context.U
    fetch.cameFrom(number) := isNew
    when(isNew) {
      fetch.isPending  := isLegal
      fetch.isIllegal  := !isLegal
      fetch.isIssued   := false.B
      fetch.isExpected := false.B
      fetch.sleeps.foreach(_ := false.B)
      fetch.insists.foreach(_ := false.B)
      fetch.kind    := port.bits.kind
      fetch.address := port.bits.address
    }
  }
  when(io.start) { buffers.foreach(_.state := BufferState.empty) }

  io.waitsForTriangles := fetches.map(fetch => fetch.hasRecord && fetch.kind === RecordKind.triangles).reduce(_ || _)
  io.stalledContexts   := PopCount(fetches.map(_.isPending))
  io.readyContexts     := PopCount(fetches.map(_.hasRecord) :+ io.response.valid)
}

object RecordFetch {

  /** Record kinds by falling priority. */
  private val priority: Seq[Int] =
    Seq(RecordKind.triangles, RecordKind.attributes, RecordKind.node).map(_.litValue.toInt)
}
