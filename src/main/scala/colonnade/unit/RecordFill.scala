package colonnade.unit

import chisel3._
import chisel3.util.{Mux1H, PriorityEncoder, PriorityEncoderOH, Valid}
import colonnade.common.TimingSlice
import colonnade.config.PartConfig
import colonnade.formats.{Banks, RecordBroadcast}

/** Fill: a broadcast goes to the buffer that was reserved for it. With snooping it goes to an available buffer otherwise,
  * if a context waits for it that finds it in no buffer. Every context that waits takes it from there; without snooping
  * only the one that requested it. An extra slice registers broadcasts, and the comparison of their addresses.
  *
  * @param row         of this unit
  * @param incoming    by bank
  * @param hits        by context and buffer: the lookup finds the record in the buffer
  * @param isNew       by context: its fetch came in the cycle before
  * @param isAvailable by buffer: no context needs its record
  */
private[unit] final class RecordFill(
    config:       PartConfig,
    row:          UInt,
    val incoming: Seq[Valid[RecordBroadcast]],
    fetches:      Seq[ContextFetch],
    buffers:      Seq[RecordBuffer],
    hits:         Seq[Seq[Bool]],
    isNew:        Seq[Bool],
    isAvailable:  Seq[Bool]
) {
  private val slice    = TimingSlice.extra(config)
  private val snooping = config.columnBvhMemory.snooping.B

  private val isHit = hits.map(_.reduce(_ || _))

  val broadcasts: Seq[Valid[RecordBroadcast]] = incoming.map(slice.valid(_))

  /** By bank: its broadcast has this address, which with the slice is that of the cycle before. Only the bank of the address
    * can have it.
    */
  def brings(address: UInt): Seq[Bool] = {
    val banks     = incoming.indices.map(Banks.isIn(config, address, _))
    val inBank    = Mux1H(banks, incoming.map(broadcast => Banks.addressIn(config, broadcast.bits.address)))
    val isAddress = inBank === Banks.addressIn(config, address)
    banks.map(isBank => slice(isBank && isAddress))
  }

  /** By broadcast and context: the context waits for it. The slice compares a new fetch too late. */
  val waiters: Seq[Seq[Bool]] = fetches.zip(isNew).map { case (fetch, isNew) =>
    val waits = if (slice.isEnabled) fetch.isPending && !isNew else fetch.isPending
    brings(fetch.address).map(_ && waits)
  }.transpose

  /** By broadcast and buffer: the buffer is reserved for it. */
  val awaiting: Seq[Seq[Bool]] =
    buffers.map(buffer => brings(buffer.address).map(_ && buffer.state === BufferState.reserved)).transpose

  /** The buffers that are available after the fill; by broadcast and buffer: the buffer takes its record, and takes it for a
    * context that misses it.
    */
  private val (remaining, places) =
    broadcasts.zip(waiters.zip(awaiting)).foldLeft((isAvailable, Seq.empty[(Seq[Bool], Seq[Bool])])) {
      case ((available, places), (broadcast, (waits, awaits))) =>
        val isRecord   = broadcast.valid && !broadcast.bits.isLater.getOrElse(false.B)
        val isReserved = awaits.map(_ && (snooping || broadcast.bits.row === row))
        val reservedOH = PriorityEncoderOH(isReserved).map(_ && isRecord)
        val freeOH     = PriorityEncoderOH(available).map(_ && snooping && !isReserved.reduce(_ || _) && isRecord)
        val isMissing  = waits.zip(isHit).map { case (waits, isHit) => waits && !isHit }.reduce(_ || _)
        val snoopedOH  = freeOH.map(_ && isMissing)
        (
          available.zip(snoopedOH).map { case (isFree, isTaken) => isFree && !isTaken },
          places :+ ((either(snoopedOH, reservedOH), either(freeOH, reservedOH)))
        )
    }
  val stillAvailable: Seq[Bool] = remaining
  private val (fills, fillsIfMissed) = places.unzip

  /** By buffer. */
  val isFilled: Seq[Bool] = fills.transpose.map(_.reduce(_ || _))

  /** By context and buffer: the context finds the record in the buffer, or takes it from there as it comes. */
  val found: Seq[Seq[Bool]] = fetches.zipWithIndex.map { case (fetch, context) =>
    buffers.indices.map { index =>
      val isOwnRead = fetch.isPending && fetch.isIssued && fetch.bufferOH(index)
      val arrives   = fillsIfMissed.zip(waiters).map { case (fill, waits) =>
        fill(index) && Mux(snooping, waits(context) && !isHit(context), isOwnRead)
      }
      hits(context)(index) || arrives.reduce(_ || _)
    }
  }

  for (((buffer, isFilled), from) <- buffers.zip(isFilled).zip(fills.transpose)) when(isFilled) {
    val broadcast = Mux1H(from, broadcasts.map(_.bits))
    buffer.state   := BufferState.full
    buffer.address := broadcast.address
    buffer.record  := broadcast.record
  }
  for ((fetch, found) <- fetches.zip(found)) when(found.reduce(_ || _)) {
    fetch.isPending := false.B
    fetch.hasRecord := true.B
    fetch.buffer    := PriorityEncoder(found)
  }

  private def either(some: Seq[Bool], others: Seq[Bool]): Seq[Bool] = some.zip(others).map { case (a, b) => a || b }
}
