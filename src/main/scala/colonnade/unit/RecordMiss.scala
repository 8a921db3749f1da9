package colonnade.unit

import chisel3._
import chisel3.util.{DecoupledIO, Mux1H, PriorityEncoder, PriorityEncoderOH}
import colonnade.common.TimingSlice
import colonnade.config.PartConfig
import colonnade.formats.RecordRequest

/** Miss: requests the record of the first context whose record no buffer holds or awaits, and reserves a buffer for it.
  * With snooping all contexts with its address expect it from then on. A record that comes in the same cycle needs no
  * request. An extra slice lies behind the choice of the context; then no request is sent while any record comes.
  *
  * @param matches     by context and buffer: the lookup finds its address in the buffer
  * @param isUnderWay  by context: the matches of its fetch are still to come
  * @param isAvailable by buffer: no context needs its record
  */
private[unit] final class RecordMiss(
    config:      PartConfig,
    requests:    DecoupledIO[RecordRequest],
    fetches:     Seq[ContextFetch],
    buffers:     Seq[RecordBuffer],
    matches:     Seq[Seq[Bool]],
    isUnderWay:  Seq[Bool],
    fill:        RecordFill,
    isAvailable: Seq[Bool]
) {
  private val slice    = TimingSlice.extra(config.device)
  private val snooping = config.device.columnBvhMemory.snooping.B

  // Choose a context
  private val isExpected = fetches.zip(matches).map { case (fetch, matches) =>
    val isPresent = buffers.zip(matches).map { case (buffer, isMatch) => isMatch && buffer.state =/= BufferState.empty }
    Mux(snooping, fetch.isExpected || isPresent.reduce(_ || _), fetch.isIssued)
  }
  private def misses(fetch: ContextFetch, isExpected: Bool): Bool =
    fetch.isPending && !isExpected && !fetch.awaitsFill.getOrElse(false.B)
  private val nextOH = PriorityEncoderOH(fetches.zip(isExpected).zip(isUnderWay).map {
    case ((fetch, isExpected), isUnderWay) => !isUnderWay && misses(fetch, isExpected)
  })
  private val missOH = fetches.zip(nextOH).map { case (fetch, isNext) =>
    slice.flag(isNext) && misses(fetch, Mux(snooping, fetch.isExpected, fetch.isIssued))
  }
  private val address = slice(Mux1H(nextOH, fetches.map(_.address)))

  // Request its record
  private val (isBlocked, free) =
    if (slice.isEnabled) ((fill.broadcasts ++ fill.incoming).map(_.valid).reduce(_ || _), isAvailable)
    else {
      val comes = fill.broadcasts.zip(fill.brings(address)).map { case (broadcast, brings) =>
        broadcast.valid && brings
      }
      (snooping && comes.reduce(_ || _), fill.stillAvailable)
    }
  requests.valid        := missOH.reduce(_ || _) && free.reduce(_ || _) && !isBlocked
  requests.bits.address := address
  private val isAwaited = buffers.map(buffer => buffer.state === BufferState.reserved && buffer.address === address)
  assert(!(snooping && requests.valid && isAwaited.reduce(_ || _)), "a record is requested twice")

  // Reserve a buffer
  private val reservedOH = PriorityEncoderOH(free)

  /** By buffer. */
  val isReserved: Seq[Bool] = reservedOH.map(_ && requests.fire)

  for ((fetch, isExpected) <- fetches.zip(isExpected)) fetch.isExpected := isExpected
  when(requests.fire) {
    for ((fetch, isMiss) <- fetches.zip(missOH)) {
      when(fetch.address === address) { fetch.isExpected := true.B }
      when(isMiss) {
        fetch.isIssued := true.B
        fetch.buffer   := PriorityEncoder(free)
      }
    }
  }
  for ((buffer, isReserved) <- buffers.zip(isReserved)) when(isReserved) {
    buffer.state   := BufferState.reserved
    buffer.address := address
    buffer.isPinned.foreach(_ := Mux1H(missOH, fetches.flatMap(_.retries)))
  }
}

/** With a cache, a read may be answered "later": the record's broadcast follows without a request. Then the read's
  * buffer is free again, and its contexts await the fill. If no buffer is available when it comes, they request the
  * record once more, and pin their buffer. It stays reserved, so every context gets its record in the end.
  */
private[unit] final class LaterRecords(
    fetches: Seq[ContextFetch],
    buffers: Seq[RecordBuffer],
    fill:    RecordFill
) {
  for {
    (broadcast, (waits, awaits)) <- fill.broadcasts.zip(fill.waiters.zip(fill.awaiting))
    isLater                      <- broadcast.bits.isLater
  } when(broadcast.valid) {
    val isPinned = buffers.zip(awaits).map { case (buffer, awaits) => awaits && buffer.isPinned.get }.reduce(_ || _)
    for ((buffer, awaits) <- buffers.zip(awaits)) when(isLater && awaits && !buffer.isPinned.get) {
      buffer.state := BufferState.empty
    }
    for (((fetch, waits), isFound) <- fetches.zip(waits).zip(fill.isFound)) {
      when(waits && isLater && !isPinned) {
        fetch.awaitsFill.get := true.B
        fetch.isExpected     := false.B
      }
      when(waits && !isLater && !isFound) {
        fetch.awaitsFill.get := false.B
        fetch.retries.get    := true.B
      }
    }
  }
}
