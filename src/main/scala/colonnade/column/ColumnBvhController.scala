package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Mux1H, OHToUInt, PopCount, RegEnable, Valid}
import colonnade.common.RoundRobin
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

/** A read in flight. */
final class Read(config: ColonnadeConfig) extends Bundle {
  val address = new RecordRequest(config).address.cloneType
  val row     = UInt(log2Ceil(config.recordRequesters.max(2)).W)
}

final class ReadListIO(config: ColonnadeConfig) extends Bundle {
  val push   = Flipped(Decoupled(new Read(config)))
  val oldest = Decoupled(new Read(config))

  /** All reads in flight, the oldest first. */
  val reads = Output(Vec(Banks.readsInFlight(config), Valid(new Read(config))))
}

/** The reads in flight of a bank, in order: as many as a bank has in flight at full throughput. This is a shift
  * register, because there are few, and model checkers are slow on memories.
  */
final class ReadList(config: ColonnadeConfig) extends Module {
  val io = IO(new ReadListIO(config))

  private val depth = Banks.readsInFlight(config)
  private val reads = Reg(Vec(depth, new Read(config)))
  private val count = RegInit(0.U(log2Ceil(depth + 1).W))
  private val left  = count - io.oldest.fire

  io.push.ready   := count =/= depth.U
  io.oldest.valid := count =/= 0.U
  io.oldest.bits  := reads.head
  for (((port, read), index) <- io.reads.zip(reads).zipWithIndex) {
    port.valid := count > index.U
    port.bits  := read
  }

  when(io.oldest.fire) {
    reads.zip(reads.tail).foreach { case (read, next) => read := next }
  }
  for ((read, index) <- reads.zipWithIndex) {
    when(io.push.fire && left === index.U) { read := io.push.bits }
  }
  count := left + io.push.fire
}
