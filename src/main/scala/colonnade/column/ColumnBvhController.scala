package colonnade.column

import chisel3._
import chisel3.util.{Decoupled, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RecordBroadcast, RecordRequest}
import colonnade.frame.ColumnBvhEvents

/** Ports of [[ColumnBvhController]]. */
final class ColumnBvhControllerIO(config: ColonnadeConfig) extends Bundle {
  private val banks = config.columnBvhMemory.banks

  /** One for each row; may be withdrawn while not accepted. */
  val requests = Vec(config.array.rows, Flipped(Decoupled(new RecordRequest(config))))

  /** One for each bank. */
  val broadcasts = Output(Vec(banks, Valid(new RecordBroadcast(config))))
  val memory     = Vec(banks, new BankPort(config))
  val events     = Output(new ColumnBvhEvents(config))

  /** No read is in flight. */
  val isIdle = Output(Bool())
}

/** Reads records for the render units of a column and shows each to all of them.
  *
  * A bank accepts one request a cycle, from the rows in turn, and shows the record one cycle after the memory has
  * answered: two cycles after the request for a memory of latency 1. Every accepted request is read and shown once, in
  * the bank's order of acceptance, whoever else has asked for the same record: a unit that finds its record in another
  * one's read withdraws its request by itself.
  */
final class ColumnBvhController(config: ColonnadeConfig) extends Module {
  val io = IO(new ColumnBvhControllerIO(config))

  private val readers = Seq.fill(config.columnBvhMemory.banks)(Module(new BankReader(config)))

  for ((request, row) <- io.requests.zipWithIndex) {
    val ways = readers.map(_.io.requests(row))
    ways.zipWithIndex.foreach { case (way, bank) =>
      way.valid := request.valid && Banks.isIn(config, request.bits.address, bank)
      way.bits  := request.bits
    }
    request.ready := ways.map(way => way.valid && way.ready).reduce(_ || _)
  }
  for ((reader, bank) <- readers.zipWithIndex) {
    io.memory(bank) <> reader.io.memory
    io.broadcasts(bank) := reader.io.broadcast
  }

  io.events.recordReads   := readers.map(_.io.events.recordReads).reduce(_ +& _)
  io.events.bankConflicts := readers.map(_.io.events.bankConflicts).reduce(_ +& _)
  io.isIdle               := readers.map(_.io.isIdle).reduce(_ && _)
}
