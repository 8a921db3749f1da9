package colonnade.column

import chisel3._
import chisel3.util.{Decoupled, Mux1H, OHToUInt, PopCount, RegEnable, Valid}
import colonnade.common.RoundRobin
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RecordBroadcast, RecordRequest}
import colonnade.frame.ColumnBvhEvents

/** Ports of [[BankReader]]. */
final class BankReaderIO(config: ColonnadeConfig) extends Bundle {

  /** Of rows that want a record of this bank; ready only where valid is set. */
  val requests  = Vec(config.array.rows, Flipped(Decoupled(new RecordRequest(config))))
  val broadcast = Output(Valid(new RecordBroadcast(config)))
  val memory    = new BankPort(config)
  val events    = Output(new ColumnBvhEvents(config))
  val isIdle    = Output(Bool())
}

/** One bank's part of the [[ColumnBvhController]]: an arbiter, the list of reads in flight, and the register from which
  * a record goes to all rows. The list has room for as many reads as a memory of `readLatency` holds.
  *
  * With snooping a request for a record that is in flight waits, for its row will find the record in the other one's
  * broadcast.
  */
final class BankReader(config: ColonnadeConfig) extends Module {
  val io = IO(new BankReaderIO(config))

  private val rows     = config.array.rows
  private val turn     = Module(new RoundRobin(rows))
  private val inFlight = Module(new ReadList(config))
  private val asking   = turn.io.requests
  private val accepts  = io.memory.request.fire

  // Choose a row
  private val isComing = io.requests.map { request =>
    val isRead = inFlight.io.reads.map(read => read.valid && read.bits.address === request.bits.address)
    config.columnBvhMemory.snooping.B && isRead.reduce(_ || _)
  }
  turn.io.requests := VecInit(io.requests.zip(isComing).map { case (request, comes) => request.valid && !comes }).asUInt
  turn.io.isTaken  := accepts
  io.requests.zip(turn.io.grant.asBools).foreach { case (request, isGranted) =>
    request.ready := isGranted && io.memory.request.ready && inFlight.io.begins.ready
  }

  // Read, and note for whom
  private val address = Mux1H(turn.io.grant, io.requests.map(_.bits.address))
  io.memory.request.valid         := asking.orR && inFlight.io.begins.ready
  io.memory.request.bits          := Banks.addressIn(config, address)
  inFlight.io.begins.valid        := accepts
  inFlight.io.begins.bits.address := address
  inFlight.io.begins.bits.row     := OHToUInt(turn.io.grant)

  // Show the record to everybody
  private val answers   = io.memory.response.valid
  private val broadcast = Wire(new RecordBroadcast(config))
  broadcast.address        := inFlight.io.oldest.bits.address
  broadcast.row            := inFlight.io.oldest.bits.row
  broadcast.record         := io.memory.response.bits
  inFlight.io.oldest.ready := answers
  io.broadcast.valid       := RegNext(answers, false.B)
  io.broadcast.bits        := RegEnable(broadcast, answers)
  assert(!answers || inFlight.io.oldest.valid, "a bank answers without a question")

  io.events.recordReads   := accepts
  io.events.bankConflicts := Mux(accepts, PopCount(asking) - 1.U, 0.U)
  io.isIdle               := !inFlight.io.oldest.valid && !io.broadcast.valid
}
