package colonnade.memory

import chisel3._
import chisel3.util.{Decoupled, Pipe, Queue, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Banks, Load, LoadTarget, RecordFormats}

final class ColumnBvhMemoryIO(config: ColonnadeConfig) extends Bundle {
  val load = Flipped(Valid(new Load(config))) // only while no read is in flight

  /** By bank: the bank neither accepts nor responds. */
  val holds = if (config.columnBvhMemory.holdable) Some(Input(UInt(config.columnBvhMemory.banks.W))) else None
  val banks = Vec(config.columnBvhMemory.banks, Flipped(new BankPort(config)))
}

/** The record memory of a column. Each bank accepts one read per cycle and responds `readLatency` cycles later.
  *
  * A bank has a single port, because reads and loads exclude each other. Latency beyond one cycle is spent in registers
  * before the memory, which hold addresses instead of records. A bank that can be held has a queue for its responses. A
  * load beyond the depth is dropped.
  */
final class ColumnBvhMemory(config: ColonnadeConfig) extends Module {
  val io = IO(new ColumnBvhMemoryIO(config))

  private val isForUs = io.load.valid && io.load.bits.target === LoadTarget.columnBvh(config) &&
    io.load.bits.address < config.columnBvhMemory.depth.U
  private val loadAddress = io.load.bits.address(RecordFormats.addressBits(config) - 1, 0)

  for ((port, bank) <- io.banks.zipWithIndex) {
    val records = SyncReadMem(Banks.depth(config), new RecordFormats(config).record)
    val read    = Pipe(port.request.fire, port.request.bits, config.columnBvhMemory.readLatency - 1)
    val writes  = isForUs && Banks.isIn(config, loadAddress, bank)
    assert(!(writes && read.valid), "a load during a read")

    val address   = Mux(writes, Banks.addressIn(config, loadAddress), read.bits)
    val response  = Wire(Decoupled(new RecordFormats(config).record))
    val responses =
      if (config.columnBvhMemory.holdable) Queue(response, Banks.readsInFlight(config), flow = true) else response
    val isHeld = io.holds.map(_(bank)).getOrElse(false.B)
    response.valid            := RegNext(read.valid, false.B)
    response.bits             := records.readWrite(address, io.load.bits.record, writes || read.valid, writes)
    responses.ready           := !isHeld
    port.request.ready        := !isHeld
    port.response.valid       := responses.fire
    port.response.bits.record := responses.bits
  }
}

/** The answer to a request of a bank: the record, or that it comes later. */
final class BankResponse(config: ColonnadeConfig) extends Bundle {
  val record = new RecordFormats(config).record

  /** A cache does not hold the record. A fill will bring it. */
  val isLater = if (config.columnBvhMemory.cache.nonEmpty) Some(Bool()) else None
}

/** The read port of one bank. Responses come in the order of requests, and cannot be stalled. */
final class BankPort(config: ColonnadeConfig) extends Bundle {
  val request  = Decoupled(UInt(Banks.addressBits(config).W)) // address in the bank
  val response = Flipped(Valid(new BankResponse(config)))

  /** From a cache: a record that nobody requests in this cycle, and its address in the bank; never with a response. */
  val fill = if (config.columnBvhMemory.cache.nonEmpty) Some(Flipped(Valid(new BankFill(config)))) else None
}

/** A record that a cache receives. */
final class BankFill(config: ColonnadeConfig) extends Bundle {
  val address = UInt(Banks.addressBits(config).W)
  val record  = new RecordFormats(config).record
}
