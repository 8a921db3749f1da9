package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Mux1H, OHToUInt, PopCount, RegEnable, Valid}
import colonnade.common.RoundRobin
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Banks, RecordBroadcast, RecordRequest}
import colonnade.frame.ColumnBvhEvents
import colonnade.memory.BankPort

final class BankReaderIO(config: ColonnadeConfig) extends Bundle {

  /** By row; ready only where valid is set. */
  val requests = Vec(config.recordRequesters, Flipped(Decoupled(new RecordRequest(config))))

  /** The number of the bank; constant. */
  val bank      = Input(UInt(log2Ceil(config.columnBvhMemory.banks.max(2)).W))
  val broadcast = Output(Valid(new RecordBroadcast(config)))
  val memory    = new BankPort(config)
  val events    = Output(new ColumnBvhEvents(config))
  val isIdle    = Output(Bool())
}

/** One bank's part of the [[ColumnBvhController]]: an arbiter, the list of reads in flight, and the broadcast register.
  * The list has space for the reads that the bank has in flight. Records that a cache receives are also broadcast.
  *
  * With snooping, a request for a record in flight waits, because its row will get the record from that broadcast.
  */
final class BankReader(config: ColonnadeConfig) extends Module {
  val io = IO(new BankReaderIO(config))

  private val rows     = config.recordRequesters
  private val arbiter  = Module(new RoundRobin(rows))
  private val inFlight = Module(new ReadList(config))
  private val asking   = arbiter.io.requests
  private val accepts  = io.memory.request.fire

  // Select a row
  private val isComing = io.requests.map { request =>
    val isRead = inFlight.io.reads.map(read => read.valid && read.bits.address === request.bits.address)
    config.columnBvhMemory.snooping.B && isRead.reduce(_ || _)
  }
  arbiter.io.requests := VecInit(io.requests.zip(isComing).map { case (request, comes) =>
    request.valid && !comes
  }).asUInt
  arbiter.io.isTaken := accepts
  io.requests.zip(arbiter.io.grant.asBools).foreach { case (request, isGranted) =>
    request.ready := isGranted && io.memory.request.ready && inFlight.io.push.ready
  }

  // Read, and store the row
  private val address = Mux1H(arbiter.io.grant, io.requests.map(_.bits.address))
  io.memory.request.valid       := asking.orR && inFlight.io.push.ready
  io.memory.request.bits        := Banks.addressIn(config, address)
  inFlight.io.push.valid        := accepts
  inFlight.io.push.bits.address := address
  inFlight.io.push.bits.row     := OHToUInt(arbiter.io.grant)

  // Broadcast the record
  private val answers   = io.memory.response.valid
  private val fills     = io.memory.fill.fold(false.B)(_.valid)
  private val broadcast = Wire(new RecordBroadcast(config))
  broadcast.address := inFlight.io.oldest.bits.address
  broadcast.row     := inFlight.io.oldest.bits.row
  broadcast.record  := io.memory.response.bits.record
  broadcast.isLater.zip(io.memory.response.bits.isLater).foreach { case (isLater, answer) => isLater := answer }
  for (fill <- io.memory.fill) {
    when(fill.valid) {
      broadcast.address := Banks.recordOf(config, fill.bits.address, io.bank)
      broadcast.record  := fill.bits.record
      broadcast.isLater.foreach(_ := false.B)
    }
    assert(!(answers && fill.valid), "a bank answers a request while it is filled")
  }
  inFlight.io.oldest.ready := answers
  io.broadcast.valid       := RegNext(answers || fills, false.B)
  io.broadcast.bits        := RegEnable(broadcast, answers || fills)
  assert(!answers || inFlight.io.oldest.valid, "a bank responds without a request")

  io.events.recordReads   := accepts
  io.events.bankConflicts := Mux(accepts, PopCount(asking) - 1.U, 0.U)
  for (misses <- io.events.cacheMisses; isLater <- io.memory.response.bits.isLater) misses := answers && isLater
  io.isIdle := !inFlight.io.oldest.valid && !io.broadcast.valid
}
