package colonnade.axi

import chisel3._
import chisel3.util.Decoupled

/** An address of AXI4-Lite. */
final class AxiLiteAddress(addressBits: Int) extends Bundle {
  val addr = UInt(addressBits.W)
  val prot = UInt(3.W)
}

final class AxiLiteWriteData extends Bundle {
  val data = UInt(AxiLite.dataBits.W)
  val strb = UInt((AxiLite.dataBits / 8).W)
}

final class AxiLiteWriteResponse extends Bundle {
  val resp = UInt(2.W)
}

final class AxiLiteReadData extends Bundle {
  val data = UInt(AxiLite.dataBits.W)
  val resp = UInt(2.W)
}

/** The channels of an AXI4-Lite master. */
final class AxiLitePort(addressBits: Int) extends Bundle {
  val aw = Decoupled(new AxiLiteAddress(addressBits))
  val w  = Decoupled(new AxiLiteWriteData)
  val b  = Flipped(Decoupled(new AxiLiteWriteResponse))
  val ar = Decoupled(new AxiLiteAddress(addressBits))
  val r  = Flipped(Decoupled(new AxiLiteReadData))
}

object AxiLite {
  val dataBits: Int = 32
}
