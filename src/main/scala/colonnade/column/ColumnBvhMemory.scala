package colonnade.column

import chisel3._
import chisel3.util.{Pipe, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Load, LoadTarget, RecordFormats}

/** Ports of [[ColumnBvhMemory]]. */
final class ColumnBvhMemoryIO(config: ColonnadeConfig) extends Bundle {

  /** Only while no read is in flight. */
  val load  = Flipped(Valid(new Load(config)))
  val banks = Vec(config.columnBvhMemory.banks, Flipped(new BankPort(config)))
}

/** The records that the render units of a column share. Each bank answers one read a cycle, `readLatency` cycles later.
  *
  * A bank has a single port, for reads and loads exclude each other; cycles of latency beyond the first are spent before
  * it, where a register holds an address and not a record.
  */
final class ColumnBvhMemory(config: ColonnadeConfig) extends Module {
  val io = IO(new ColumnBvhMemoryIO(config))

  private val isForUs = io.load.valid && io.load.bits.target === LoadTarget.columnBvh

  for ((port, bank) <- io.banks.zipWithIndex) {
    val records = SyncReadMem(Banks.depth(config), new RecordFormats(config).record)
    val read    = Pipe(port.request.fire, port.request.bits, config.columnBvhMemory.readLatency - 1)
    val writes  = isForUs && Banks.isIn(config, io.load.bits.address, bank)
    assert(!(writes && read.valid), "a load during a read")

    val address = Mux(writes, Banks.addressIn(config, io.load.bits.address), read.bits)
    port.request.ready  := true.B
    port.response.valid := RegNext(read.valid, false.B)
    port.response.bits  := records.readWrite(address, io.load.bits.record, writes || read.valid, writes)
  }
}
