package colonnade.query

import chisel3._
import chisel3.util.Queue
import colonnade.axi.{AxiPins, AxiReadPort, AxiWritePort}
import colonnade.formats.RayBatch

/** A unit whose ports are the pins of a memory. */
abstract class MemoryUnit(idBits: Int = 1) extends Module {
  val pins: AxiPins = IO(AxiPins.readsAndWrites(idBits, RayBatch.bytes)).suggestName("m_axi")

  /** Connects them; a port that the unit lacks sends nothing. */
  protected def attach(read: Option[AxiReadPort] = None, write: Option[AxiWritePort] = None): Unit = {
    val reads  = read.getOrElse(WireInit(0.U.asTypeOf(new AxiReadPort(idBits, RayBatch.bytes))))
    val writes = write.getOrElse(WireInit(0.U.asTypeOf(new AxiWritePort(idBits, RayBatch.bytes))))
    Seq("aw" -> writes.aw, "w" -> writes.w, "ar" -> reads.ar).foreach { case (channel, from) =>
      pins.drive(channel, from)
    }
    pins.receive("b", writes.b)
    pins.receive("r", reads.r)
  }

  /** The same behind registers, which hold the addresses that the unit chooses among several. */
  protected def attachHeld(read: AxiReadPort, write: AxiWritePort): Unit = {
    val reads  = Wire(chiselTypeOf(read))
    val writes = Wire(chiselTypeOf(write))
    reads :<>= read
    writes :<>= write
    reads.ar :<>= Queue(read.ar, 1)
    writes.aw :<>= Queue(write.aw, 1)
    attach(Some(reads), Some(writes))
  }
}
