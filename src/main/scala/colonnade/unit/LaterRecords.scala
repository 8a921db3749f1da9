package colonnade.unit

import chisel3._

/** With a cache, a read may be answered "later": the record's broadcast follows without a request. Then the read's buffer is
  * free again, and its contexts await the fill. If no buffer is available when it comes, they request the record once more,
  * and pin their buffer. It stays reserved, so every context gets its record in the end.
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
