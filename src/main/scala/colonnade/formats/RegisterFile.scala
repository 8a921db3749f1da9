package colonnade.formats

import chisel3._
import chisel3.util.{log2Ceil, Cat, RegEnable, UIntToOH}
import colonnade.config.ColonnadeConfig

/** The host's port to the registers: one word per cycle. */
final class RegisterPort(addressBits: Int) extends Bundle {
  val write     = Input(Bool())
  val read      = Input(Bool())
  val address   = Input(UInt(addressBits.W)) // word address
  val writeData = Input(UInt(RegisterMap.dataBits.W))

  /** Result of the last read, from one cycle after it until the next read. Unused bits and unknown addresses read as 0.
    */
  val readData = Output(UInt(RegisterMap.dataBits.W))
}

final class RegisterFileIO[S <: Bundle with SceneRegisters, D <: Bundle with BusyRegisters](
    config:   ColonnadeConfig,
    settings: => S,
    status:   => D
) extends Bundle {
  val register = new RegisterPort(RegisterFile.addressBits(config))
  val frame    = Output(settings)
  val device   = Input(status)

  /** Pulses: a frame starts; caches forget the scene. */
  val start      = Output(Bool())
  val invalidate = if (config.columnBvhMemory.cache.nonEmpty) Some(Output(Bool())) else None

  /** Of a device for rays. */
  val commands = RegisterMap.commands(config).map(Output(_))
}

/** The registers of the host, at the addresses of [[RegisterMap]]. Settings above their limit are clamped for the
  * device.
  *
  * Writes are ignored while the device is busy, so the settings of a frame are constant. A read takes one cycle. The
  * words of a wide number are read one by one, so it is consistent only while the device is idle.
  *
  * @param settings registers that the host writes
  * @param status   registers that the host reads
  */
final class RegisterFile[S <: Bundle with SceneRegisters, D <: Bundle with BusyRegisters](
    config:   ColonnadeConfig,
    settings: => S,
    status:   => D
) extends Module {
  val io = IO(new RegisterFileIO(config, settings, status))

  private val registers = RegisterMap(config)

  private val writes = io.register.write && !io.device.status.busy

  // Settings: one hardware register per number, combined to the bundle by its layout.
  private val written = registers.filter(_.access == Access.ReadWrite).map(r => r -> storage(r))
  private val legal   = written.map { case (r, value) => r.name -> RegisterLimits.clamp(value, r.limit) }.toMap
  io.frame := Cat(Layout.of(io.frame).sortBy(-_.offset).map(field => legal(field.name))).asTypeOf(io.frame)

  // Control: a pulse in the cycle of the write.
  private def pulse(name: String): Bool =
    writes && io.register.address === registers.find(_.name == name).get.address.U && io.register.writeData(0)
  io.start := pulse("control.start")
  io.invalidate.foreach(_ := pulse("control.invalidate"))

  // Commands have one word each, and may be written while the device is busy
  for (commands <- io.commands) {
    val values = Layout.of(commands).map { field =>
      val register = registers.find(_.name == s"rays.${field.name}").get
      RegEnable(
        io.register.writeData(field.width - 1, 0),
        0.U(field.width.W),
        io.register.write && io.register.address === register.address.U
      )
    }
    commands := Cat(values).asTypeOf(commands)
  }

  // Reads of status
  private val fields   = Layout.of(io.device).map(field => field.name -> field).toMap
  private val observed = registers.filter(_.access == Access.ReadOnly).map { r =>
    val field = fields(r.name)
    r -> io.device.asUInt(field.end - 1, field.offset)
  }
  private val words = (for {
    (r, value) <- observed
    word       <- 0 until r.words
  } yield r.address + word -> wordOf(value, word)).toMap

  // A multiplexer tree over the bits of the address: synthesis may turn an OR over all words into a chain
  private val readData  = Reg(UInt(RegisterMap.dataBits.W))
  private val addresses = 1 << io.register.address.getWidth
  private val shown     = VecInit(Seq.tabulate(addresses)(words.getOrElse(_, 0.U(readData.getWidth.W))))
  when(io.register.read)(readData := shown(io.register.address))

  // Settings are read from a memory of copies: registers all over the device need no way back
  private val masks = written.flatMap { case (r, _) =>
    (0 until r.words).map(word => r.address + word -> ((BigInt(1) << wordBits(r, word)) - 1))
  }.toMap
  private val first     = masks.keys.min
  private val count     = masks.keys.max + 1 - first
  private val index     = (io.register.address - first.U)(log2Ceil(count) - 1, 0)
  private val isSetting = VecInit(Seq.tabulate(addresses)(masks.contains(_).B))(io.register.address)
  private val mask      = VecInit(Seq.tabulate(addresses)(masks.getOrElse(_, BigInt(0)).U(RegisterMap.dataBits.W)))
  private val copies    = SyncReadMem(count, UInt(RegisterMap.dataBits.W))
  private val isWritten = RegInit(0.U(count.W))
  private val isCopy    = RegNext(io.register.read && isSetting && (isWritten >> index)(0), false.B)
  private val copy      = copies.read(index, io.register.read && isSetting)
  when(writes && isSetting) {
    copies.write(index, io.register.writeData & mask(io.register.address))
    isWritten := isWritten | UIntToOH(index, count)
  }
  when(isCopy) { readData := copy }
  io.register.readData := Mux(isCopy, copy, readData)

  private def wordOf(value: UInt, word: Int): UInt = {
    val low = word * RegisterMap.dataBits
    value((low + RegisterMap.dataBits).min(value.getWidth) - 1, low).pad(RegisterMap.dataBits)
  }

  private def wordBits(register: Register, word: Int): Int =
    (register.width - word * RegisterMap.dataBits).min(RegisterMap.dataBits)

  private def storage(register: Register): UInt = Cat((0 until register.words).reverse.map { word =>
    val bits  = wordBits(register, word)
    val value = (if (register.hasReset) RegInit(0.U(bits.W)) else Reg(UInt(bits.W)))
      .suggestName(s"${register.name.replaceAll("[.\\[]", "_").replace("]", "")}_$word")
    when(writes && io.register.address === (register.address + word).U) {
      value := io.register.writeData(bits - 1, 0)
    }
    value
  })
}

object RegisterFile {
  type OfFrames = RegisterFile[FrameRegisters, DeviceStatus]
  type OfRays   = RegisterFile[RayRegisters, RayStatus]

  def ofFrames(config: ColonnadeConfig): OfFrames =
    new RegisterFile(config, new FrameRegisters(config), new DeviceStatus(config))

  def ofRays(config: ColonnadeConfig): OfRays =
    new RegisterFile(config, new RayRegisters(config), new RayStatus(config))

  def addressBits(config: ColonnadeConfig): Int = log2Ceil(RegisterMap.size(RegisterMap(config)))
}
