package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.formats.RecordRequest

/** A read in flight. */
final class Read(config: ColonnadeConfig) extends Bundle {
  val address = new RecordRequest(config).address.cloneType
  val row     = UInt(log2Ceil(config.array.rows.max(2)).W)
}

/** Ports of [[ReadList]]. */
final class ReadListIO(config: ColonnadeConfig) extends Bundle {
  val begins = Flipped(Decoupled(new Read(config)))
  val oldest = Decoupled(new Read(config))

  /** All of them. */
  val reads = Output(Vec(ReadList.room(config), Valid(new Read(config))))
}

object ReadList {
  def room(config: ColonnadeConfig): Int = config.columnBvhMemory.readLatency + 1
}

/** The reads of a bank that are in flight, in order: as many as a memory of `readLatency` holds when it accepts one a
  * cycle. They move up through registers, for there are few, and model checkers are slow on memories.
  */
final class ReadList(config: ColonnadeConfig) extends Module {
  val io = IO(new ReadListIO(config))

  private val room  = ReadList.room(config)
  private val reads = Reg(Vec(room, new Read(config)))
  private val count = RegInit(0.U(log2Ceil(room + 1).W))
  private val left  = count - io.oldest.fire

  io.begins.ready := count =/= room.U
  io.oldest.valid := count =/= 0.U
  io.oldest.bits  := reads.head
  for (((port, read), place) <- io.reads.zip(reads).zipWithIndex) {
    port.valid := count > place.U
    port.bits  := read
  }

  when(io.oldest.fire) {
    reads.zip(reads.tail).foreach { case (read, next) => read := next }
  }
  for ((read, place) <- reads.zipWithIndex) {
    when(io.begins.fire && left === place.U) { read := io.begins.bits }
  }
  count := left + io.begins.fire
}
