package colonnade.axi

import chisel3._
import chisel3.util.{log2Ceil, Decoupled}

/** Numbers of AXI4 that all ports share. */
object Axi {
  val addressBits: Int  = 40       // byte addresses: 1 TB
  val incr:        UInt = 1.U(2.W) // `burst` of incrementing addresses; the ports use no other kind
  val protection:  UInt = 2.U(3.W) // `prot` of all accesses: data, unprivileged and non-secure

  /** Answers (`resp`): success, and an error of the addressed device. */
  val okay:       UInt = 0.U(2.W)
  val slaveError: UInt = 2.U(2.W)

  /** The code of a beat's bytes for `size`. */
  def size(busBytes: Int): UInt = log2Ceil(busBytes).U(3.W)
}

/** A burst's address, of a read or a write. */
final class AxiAddress(idBits: Int) extends Bundle {
  val id    = UInt(idBits.W)
  val addr  = UInt(Axi.addressBits.W)
  val len   = UInt(8.W)
  val size  = UInt(3.W)
  val burst = UInt(2.W)
}

/** A beat of a read. */
final class AxiReadData(idBits: Int, busBytes: Int) extends Bundle {
  val id   = UInt(idBits.W)
  val data = UInt((8 * busBytes).W)
  val resp = UInt(2.W)
  val last = Bool()
}

/** A beat of a write; only bytes with their bit of `strb` are written. */
final class AxiWriteData(busBytes: Int) extends Bundle {
  val data = UInt((8 * busBytes).W)
  val strb = UInt(busBytes.W)
  val last = Bool()
}

/** The answer to a write. */
final class AxiWriteResponse(idBits: Int) extends Bundle {
  val id   = UInt(idBits.W)
  val resp = UInt(2.W)
}

/** The read channels of an AXI4 master. */
final class AxiReadPort(idBits: Int, busBytes: Int) extends Bundle {
  val ar = Decoupled(new AxiAddress(idBits))
  val r  = Flipped(Decoupled(new AxiReadData(idBits, busBytes)))
}

/** The write channels of an AXI4 master. */
final class AxiWritePort(idBits: Int, busBytes: Int) extends Bundle {
  val aw = Decoupled(new AxiAddress(idBits))
  val w  = Decoupled(new AxiWriteData(busBytes))
  val b  = Flipped(Decoupled(new AxiWriteResponse(idBits)))
}
