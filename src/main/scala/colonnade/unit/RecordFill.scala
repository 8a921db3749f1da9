package colonnade.unit

import chisel3._
import chisel3.util.{Mux1H, OHToUInt, PriorityEncoder, PriorityEncoderOH, Valid}
import colonnade.common.TimingSlice
import colonnade.config.PartConfig
import colonnade.formats.{Banks, RecordBroadcast}

/** Fill: a broadcast goes to the buffer that was reserved for it. With snooping it goes to an available buffer
  * otherwise, if a context waits for it that finds it in no buffer. Every context that waits takes it from there;
  * without snooping only the one that requested it. An extra slice registers broadcasts, and the comparison of their
  * addresses; then no record is snooped for a context whose lookup has no result yet.
  *
  * @param row         of this unit
  * @param incoming    by bank
  * @param hits        by context and buffer: the lookup finds the record in the buffer
  * @param isAvailable by buffer: no context needs its record
  */
private[unit] final class RecordFill(
    config:       PartConfig,
    row:          UInt,
    val incoming: Seq[Valid[RecordBroadcast]],
    fetches:      Seq[ContextFetch],
    buffers:      Seq[RecordBuffer],
    hits:         Seq[Seq[Bool]],
    lookup:       RecordLookupIO,
    isAvailable:  Seq[Bool]
) {
  private val slice    = TimingSlice.extra(config.device)
  private val snooping = config.device.columnBvhMemory.snooping.B

  private val isHit = hits.map(_.reduce(_ || _))

  val broadcasts: Seq[Valid[RecordBroadcast]] = incoming.map(slice.valid(_))

  /** By bank: its broadcast has this address, with the slice the cycle before's. Only the bank of the address
    * can have it.
    */
  def brings(address: UInt): Seq[Bool] = {
    val banks     = incoming.indices.map(Banks.isIn(config.device, address, _))
    val inBank    = Mux1H(banks, incoming.map(broadcast => Banks.addressIn(config.device, broadcast.bits.address)))
    val isAddress = inBank === Banks.addressIn(config.device, address)
    banks.map(isBank => slice(isBank && isAddress))
  }

  private val brought = fetches.map(fetch => brings(fetch.address))

  /** By broadcast and context: the context waits for it. The slice compares a new fetch too late. */
  val waiters: Seq[Seq[Bool]] = fetches.zip(brought).zip(lookup.isNew).map { case ((fetch, brought), isNew) =>
    val waits = if (slice.isEnabled) fetch.isPending && !isNew else fetch.isPending
    brought.map(_ && waits)
  }.transpose

  /** By broadcast and context: it may be snooped for the context. */
  private val snoopers: Seq[Seq[Bool]] =
    if (slice.isEnabled)
      fetches.zip(brought).zip(lookup.isSettling).map { case ((fetch, brought), isSettling) =>
        brought.map(_ && fetch.isPending && !isSettling)
      }.transpose
    else waiters

  /** By broadcast and buffer: the buffer is reserved for it. */
  val awaiting: Seq[Seq[Bool]] =
    buffers.map(buffer => brings(buffer.address).map(_ && buffer.state === BufferState.reserved)).transpose

  /** The buffers that are available after the fills; by broadcast and buffer: the buffer takes the record; it is
    * reserved for it; it would take it if a context missed it.
    */
  val (stillAvailable, fills, reserved, free) =
    broadcasts.zip(snoopers.zip(awaiting)).foldLeft(
      (isAvailable, Seq.empty[Seq[Bool]], Seq.empty[Seq[Bool]], Seq.empty[Seq[Bool]])
    ) { case ((available, fills, reserved, free), (broadcast, (snoops, awaits))) =>
      val isRecord   = broadcast.valid && !broadcast.bits.isLater.getOrElse(false.B)
      val isReserved = awaits.map(_ && (snooping || broadcast.bits.row === row))
      val isFree     = snooping && !isReserved.reduce(_ || _)
      // With the slice, a lookup that has settled has no hit
      val isMissing  = snoops.zip(isHit).map { case (snoops, isHit) => snoops && (slice.isEnabled.B || !isHit) }
      val reservedOH = PriorityEncoderOH(isReserved).map(_ && isRecord)
      val freeOH     = PriorityEncoderOH(available).map(_ && isFree && isRecord)
      val snoopedOH  = freeOH.map(_ && isMissing.reduce(_ || _))
      (
        available.zip(snoopedOH).map { case (isFree, isTaken) => isFree && !isTaken },
        fills :+ snoopedOH.zip(reservedOH).map { case (snooped, reserved) => snooped || reserved },
        reserved :+ reservedOH,
        free :+ freeOH
      )
    }

  /** By buffer. */
  val isFilled: Seq[Bool] = fills.transpose.map(_.reduce(_ || _))

  private val candidates = free.zip(reserved).map { case (free, reserved) =>
    free.zip(reserved).map { case (free, reserved) => free || reserved }
  }

  /** By context and broadcast: the context takes the record as it comes, if it does not find it in a buffer. */
  private val arrives = fetches.zip(waiters.transpose.zip(snoopers.transpose)).map { case (fetch, (waits, snoops)) =>
    val comes = waits.zip(reserved).zip(snoops.zip(free)).map { case ((waits, reserved), (snoops, free)) =>
      waits && reserved.reduce(_ || _) || snoops && free.reduce(_ || _)
    }
    comes.zip(candidates).map { case (comes, candidates) =>
      val isOwnRead = fetch.isPending && fetch.isIssued && Mux1H(fetch.bufferOH, candidates)
      Mux(snooping, comes, isOwnRead)
    }
  }

  /** By context: it has its record. */
  val isFound: Seq[Bool] = isHit.zip(arrives).map { case (isHit, arrives) => isHit || arrives.reduce(_ || _) }

  for (((buffer, isFilled), from) <- buffers.zip(isFilled).zip(fills.transpose)) when(isFilled) {
    val broadcast = Mux1H(from, broadcasts.map(_.bits))
    buffer.state   := BufferState.full
    buffer.address := broadcast.address
    buffer.record  := broadcast.record
  }
  for ((((fetch, isFound), arrives), (hits, isHit)) <- fetches.zip(isFound).zip(arrives).zip(hits.zip(isHit)))
    when(isFound) {
      fetch.isPending := false.B
      fetch.hasRecord := true.B
      fetch.buffer    := Mux(isHit, PriorityEncoder(hits), Mux1H(arrives, candidates.map(OHToUInt(_))))
    }
}
