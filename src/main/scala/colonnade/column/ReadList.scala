package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Banks, RecordRequest}

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
