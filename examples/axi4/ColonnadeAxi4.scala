package colonnade.examples

import chisel3._

/** Pins of an AXI4 port of `colonnade_axi4.sv`, as its master sees them.
  *
  * @param hasAttributes
  *   with `lock`, `cache`, `prot` and `qos`
  */
class Axi4Pins(idBits: Int, addressBits: Int, dataBytes: Int, hasAttributes: Boolean) extends Bundle {
  private def attribute(bits: Int): Option[UInt] = Option.when(hasAttributes)(Output(UInt(bits.W)))

  val awid    = Output(UInt(idBits.W))
  val awaddr  = Output(UInt(addressBits.W))
  val awlen   = Output(UInt(8.W))
  val awsize  = Output(UInt(3.W))
  val awburst = Output(UInt(2.W))
  val awlock  = attribute(1)
  val awcache = attribute(4)
  val awprot  = attribute(3)
  val awqos   = attribute(4)
  val awvalid = Output(Bool())
  val awready = Input(Bool())

  val wdata  = Output(UInt((8 * dataBytes).W))
  val wstrb  = Output(UInt(dataBytes.W))
  val wlast  = Output(Bool())
  val wvalid = Output(Bool())
  val wready = Input(Bool())

  val bid    = Input(UInt(idBits.W))
  val bresp  = Input(UInt(2.W))
  val bvalid = Input(Bool())
  val bready = Output(Bool())

  val arid    = Output(UInt(idBits.W))
  val araddr  = Output(UInt(addressBits.W))
  val arlen   = Output(UInt(8.W))
  val arsize  = Output(UInt(3.W))
  val arburst = Output(UInt(2.W))
  val arlock  = attribute(1)
  val arcache = attribute(4)
  val arprot  = attribute(3)
  val arqos   = attribute(4)
  val arvalid = Output(Bool())
  val arready = Input(Bool())

  val rid    = Input(UInt(idBits.W))
  val rdata  = Input(UInt((8 * dataBytes).W))
  val rresp  = Input(UInt(2.W))
  val rlast  = Input(Bool())
  val rvalid = Input(Bool())
  val rready = Output(Bool())
}

/** The top `colonnade_axi4`, for systems in Chisel. The default widths are Rocket Chip's for MMIO and slave ports.
  *
  * @param masterBytes
  *   `--axi` of the design
  * @param deviceIdBits
  *   of the design's memory port
  */
class ColonnadeAxi4(slaveIdBits: Int = 4, masterIdBits: Int = 8, masterBytes: Int = 8, deviceIdBits: Int = 1)
    extends BlackBox(
      Map(
        "SLAVE_ID"     -> slaveIdBits,
        "MASTER_ID"    -> masterIdBits,
        "MASTER_BYTES" -> masterBytes,
        "DEVICE_ID"    -> deviceIdBits
      )
    ) {
  override def desiredName = "colonnade_axi4"

  val io = IO(new Bundle {
    val clock = Input(Clock())
    val reset = Input(Bool())
    val irq   = Output(Bool())
    val s_axi = Flipped(new Axi4Pins(slaveIdBits, 32, 8, hasAttributes = false))
    val m_axi = new Axi4Pins(masterIdBits, 40, masterBytes, hasAttributes = true)
  })
}
