package colonnade.unit

import chisel3._
import chisel3.util.{Mux1H, OHToUInt, PopCount, PriorityEncoderOH}
import colonnade.common.TimingSlice
import colonnade.config.PartConfig

/** Fetches records for contexts: a small file of fill buffers with miss handling and snooping; docs/path-tracer.md,
  * fetching records. A buffer is reserved before a read is requested, so a broadcast never stalls.
  *
  * A unit says one cycle ahead that it accepts a record (`readyNext`). A response comes at the earliest two cycles
  * after the record's broadcast, or two cycles after the request if a buffer holds the record. With `units.extraSlices`
  * it is three, or five.
  */
final class RecordFetch(config: PartConfig) extends Module {
  val io = IO(new RecordFetchIO(config))

  private val slice    = TimingSlice.extra(config.device)
  private val snooping = config.device.columnBvhMemory.snooping.B
  private val buffers  = Seq.fill(config.device.columnBvhMemory.recordBuffers)(new RecordBuffer(config))
  private val fetches  = Seq.fill(config.contexts)(new ContextFetch(config))

  // What a fetch finds in the buffers, and in full ones: by context and buffer
  private val lookup = Module(new RecordLookup(config)).io
  lookup.fetches   := io.fetches
  lookup.addresses := VecInit(buffers.map(_.address))
  private val matches = fetches.zip(lookup.matches).map { case (fetch, matches) =>
    matches.map(_ && fetch.isPending && snooping)
  }
  private val hits = matches.map(_.zip(buffers).map { case (isMatch, buffer) =>
    isMatch && buffer.state === BufferState.full
  })

  // A full buffer may be replaced when no context uses its record
  private val held        = fetches.map(fetch => fetch.bufferOH.map(_ && fetch.hasRecord))
  private val isAvailable = buffers.zip(hits.transpose.zip(held.transpose)).map { case (buffer, (hits, held)) =>
    val isUsed = (hits ++ held).reduce(_ || _)
    buffer.state === BufferState.empty || (buffer.state === BufferState.full && !isUsed)
  }

  private val fill = new RecordFill(config, io.row, io.broadcasts, fetches, buffers, hits, lookup, isAvailable)
  private val miss =
    new RecordMiss(config, io.requests, fetches, buffers, matches, lookup.isUnderWay, fill, isAvailable)
  new LaterRecords(fetches, buffers, fill)
  lookup.isWritten := VecInit(fill.isFilled.zip(miss.isReserved).map { case (filled, reserved) => filled || reserved })

  // A context is ready in the cycle of its hit; an extra slice makes it the next one
  private val readyHits = hits.map(hits => if (slice.isEnabled) hits.map(_ => false.B) else PriorityEncoderOH(hits))
  private val grant     = Module(new RecordGrant(config)).io
  grant.readyNext := io.readyNext
  for ((fetch, context) <- fetches.zipWithIndex) {
    val holders = held(context).zip(readyHits(context))
    grant.kinds(context)   := fetch.kind
    grant.isReady(context) := fetch.hasRecord || readyHits(context).reduce(_ || _)
    grant.holders(context) := VecInit(holders.map { case (held, hit) => held || (hit && !fetch.hasRecord) })
    when(grant.grantOH(context)) { fetch.hasRecord := false.B }
  }
  private val granted = grant.granted.bits
  io.grantNext             := grant.grantNext
  io.grantsNodeNext        := grant.grantsNodeNext
  io.response.valid        := grant.granted.valid
  io.response.bits.context := granted.context
  io.response.bits.kind    := granted.kind
  io.response.bits.address := Mux1H(granted.buffer, buffers.map(_.address))
  io.response.bits.record  := Mux1H(granted.buffer, buffers.map(_.record))

  // Report illegal addresses
  private val illegalOH = PriorityEncoderOH(fetches.map(_.isIllegal))
  io.error.valid        := illegalOH.reduce(_ || _)
  io.error.bits.context := OHToUInt(illegalOH)
  io.error.bits.kind    := RecordKind.safe(Mux1H(illegalOH, fetches.map(_.kind.asUInt)))._1
  for ((fetch, isReported) <- fetches.zip(illegalOH)) when(isReported) { fetch.isIllegal := false.B }

  // New fetches
  for {
    port <- io.fetches
    isLegal = port.bits.address < io.scene.recordCount
    (fetch, context) <- fetches.zipWithIndex
  } when(port.valid && port.bits.context === context.U) {
    fetch.isPending  := isLegal
    fetch.isIllegal  := !isLegal
    fetch.isIssued   := false.B
    fetch.isExpected := false.B
    fetch.awaitsFill.foreach(_ := false.B)
    fetch.retries.foreach(_ := false.B)
    fetch.kind    := port.bits.kind
    fetch.address := port.bits.address
  }
  when(io.start) { buffers.foreach(_.state := BufferState.empty) }

  // Events
  private val snoopHits = VecInit(fetches.zip(fill.isFound).map { case (fetch, isFound) => isFound && !fetch.isIssued })
  io.snoopHits         := PopCount(TimingSlice(snoopHits))
  io.waitsForTriangles := fetches.map(fetch => fetch.hasRecord && fetch.kind === RecordKind.leaf).reduce(_ || _)
  io.stalledContexts   := PopCount(fetches.map(_.isPending))
  io.readyContexts     := PopCount(fetches.map(_.hasRecord) :+ io.response.valid)
}

object RecordFetch {

  /** Contexts that may begin a fetch in a cycle. */
  val ports: Int = 3
}
