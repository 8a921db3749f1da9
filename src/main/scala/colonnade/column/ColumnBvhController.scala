package colonnade.column

import chisel3._
import chisel3.util.{Decoupled, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Banks, RecordBroadcast, RecordRequest}
import colonnade.frame.ColumnBvhEvents
import colonnade.memory.BankPort

final class ColumnBvhControllerIO(config: ColonnadeConfig) extends Bundle {
  private val banks = config.columnBvhMemory.banks

  /** By row; a request may be withdrawn until it is accepted. */
  val requests = Vec(config.recordRequesters, Flipped(Decoupled(new RecordRequest(config))))

  val broadcasts = Output(Vec(banks, Valid(new RecordBroadcast(config)))) // by bank
  val memory     = Vec(banks, new BankPort(config))
  val events     = Output(new ColumnBvhEvents(config))
  val isIdle     = Output(Bool())                                         // no read is in flight
}

/** Reads records for the requesters of a column, which are its traversal units and its attribute fetch, and broadcasts
  * each record to all of them.
  *
  * A bank accepts one request per cycle, in round-robin order of rows. It broadcasts the record one cycle after the
  * memory's response, which is two cycles after the request for a memory of latency 1. Every accepted request gives one
  * read and one broadcast, in order per bank. A unit that gets its record from another unit's read withdraws its own
  * request.
  */
final class ColumnBvhController(config: ColonnadeConfig) extends Module {
  val io = IO(new ColumnBvhControllerIO(config))

  private val readers = Seq.fill(config.columnBvhMemory.banks)(Module(new BankReader(config)))

  for ((request, row) <- io.requests.zipWithIndex) {
    val ports = readers.map(_.io.requests(row))
    ports.zipWithIndex.foreach { case (port, bank) =>
      port.valid := request.valid && Banks.isIn(config, request.bits.address, bank)
      port.bits  := request.bits
    }
    request.ready := ports.map(port => port.valid && port.ready).reduce(_ || _)
  }
  for ((reader, bank) <- readers.zipWithIndex) {
    io.memory(bank) <> reader.io.memory
    reader.io.bank      := bank.U
    io.broadcasts(bank) := reader.io.broadcast
  }

  io.events.recordReads   := readers.map(_.io.events.recordReads).reduce(_ +& _)
  io.events.bankConflicts := readers.map(_.io.events.bankConflicts).reduce(_ +& _)
  io.events.cacheMisses.foreach(_ := readers.flatMap(_.io.events.cacheMisses).reduce(_ +& _))
  io.isIdle := readers.map(_.io.isIdle).reduce(_ && _)
}
