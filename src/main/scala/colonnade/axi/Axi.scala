package colonnade.axi

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, DecoupledIO}

import scala.collection.immutable.SeqMap

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

/** The channels of a port by their names in AXI: driven by the master, and received by it. */
final case class AxiChannels(driven: Seq[(String, Bundle)], received: Seq[(String, Bundle)])

/** The pins of an AXI port, named as block-design tools and test benches expect them: `awvalid`, `awaddr`, `wdata`, ….
  * The signal that holds them adds the prefix, as in `m_axi_awaddr`.
  */
final class AxiPins(channels: => AxiChannels, isMaster: Boolean) extends Record {
  private val all = channels.driven.map((_, true)) ++ channels.received.map((_, false))

  /** Channels of addresses, of whose protection a master of this project knows nothing: it is a constant. */
  private def isUnprotected(payload: Bundle): Boolean = payload.isInstanceOf[AxiAddress]

  val elements: SeqMap[String, Data] = SeqMap(all.flatMap { case ((channel, payload), isDriven) =>
    val isOutput                        = isDriven == isMaster
    def sent[T <: Data](data:     T): T = if (isOutput) Output(data) else Input(data)
    def answered[T <: Data](data: T): T = if (isOutput) Input(data) else Output(data)
    Seq(s"${channel}valid" -> sent(Bool()), s"${channel}ready" -> answered(Bool())) ++
      payload.elements.toSeq.reverse.map { case (field, data) => s"$channel$field" -> sent(data.cloneType) } ++
      Option.when(isUnprotected(payload))(s"${channel}prot" -> sent(UInt(3.W)))
  }: _*)

  /** Connects a channel that leaves at these pins. */
  def drive(channel: String, source: DecoupledIO[Bundle]): Unit = {
    pin(s"${channel}valid") := source.valid
    source.ready            := bit(s"${channel}ready")
    source.bits.elements.foreach { case (field, data) => pin(s"$channel$field") := data }
    if (isUnprotected(source.bits)) pin(s"${channel}prot") := Axi.protection
  }

  /** Connects a channel that comes in at these pins. */
  def receive(channel: String, sink: DecoupledIO[Bundle]): Unit = {
    sink.valid              := bit(s"${channel}valid")
    pin(s"${channel}ready") := sink.ready
    sink.bits.elements.foreach { case (field, data) => data := pin(s"$channel$field") }
  }

  /** Connects a stream without channels, such as AXI4-Stream, that leaves at these pins. */
  def stream(source: DecoupledIO[Bundle]): Unit = drive("t", source)

  /** Connects the pins of a slave to its port. */
  def attach(port: AxiLitePort): Unit = {
    Seq("aw" -> port.aw, "w" -> port.w, "ar" -> port.ar).foreach { case (channel, sink) => receive(channel, sink) }
    Seq("b" -> port.b, "r" -> port.r).foreach { case (channel, source) => drive(channel, source) }
  }

  private def pin(name: String): Data = elements(name)
  private def bit(name: String): Bool = elements(name).asUInt.asBool
}

object AxiPins {

  /** Of the device as a slave. */
  def lite(addressBits: Int): AxiPins = new AxiPins(
    AxiChannels(
      Seq(
        "aw" -> new AxiLiteAddress(addressBits),
        "w"  -> new AxiLiteWriteData,
        "ar" -> new AxiLiteAddress(addressBits)
      ),
      Seq("b" -> new AxiLiteWriteResponse, "r" -> new AxiLiteReadData)
    ),
    isMaster = false
  )

  /** Of the device as the source of an AXI4-Stream. */
  def stream(payload: => Bundle): AxiPins = new AxiPins(AxiChannels(Seq("t" -> payload), Nil), isMaster = true)

  /** Of the device as a master that reads. */
  def reads(idBits: Int, busBytes: Int): AxiPins = new AxiPins(
    AxiChannels(Seq("ar" -> new AxiAddress(idBits)), Seq("r" -> new AxiReadData(idBits, busBytes))),
    isMaster = true
  )

  /** Of the device as a master that reads and writes. */
  def readsAndWrites(idBits: Int, busBytes: Int): AxiPins = new AxiPins(
    AxiChannels(
      Seq("aw" -> new AxiAddress(idBits), "w"       -> new AxiWriteData(busBytes), "ar" -> new AxiAddress(idBits)),
      Seq("b"  -> new AxiWriteResponse(idBits), "r" -> new AxiReadData(idBits, busBytes))
    ),
    isMaster = true
  )
}
