package colonnade.bus

import colonnade.axi.AxiLite
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Access, Json, Manifest, RegisterMap}

/** A register of the shell.
  *
  * @param address byte address of its low word
  * @param width   bits; beyond 32 in two words
  */
final case class ShellRegister(name: String, address: Int, width: Int, access: Access) {
  def words: Int = (width + AxiLite.dataBits - 1) / AxiLite.dataBits
}

/** Byte addresses of AXI4-Lite: the shell's registers, the same in every design, and those of the device. */
object ShellMap {
  import Access.{ReadOnly, ReadWrite, WriteOnly}

  val addressBits: Int = 16

  /** Word 0 of the device's [[RegisterMap]]. */
  val deviceBase: Int = 0x8000

  /** "CLND" */
  val identity: BigInt = 0x434c4e44

  /** Major and minor version of these registers. A driver refuses another major version. */
  val version: BigInt = 0x00010001

  private val byteAddress = 40 // bits

  val registers: Seq[ShellRegister] = Seq(
    ShellRegister("identity", 0x00, 32, ReadOnly),
    ShellRegister("version", 0x04, 32, ReadOnly),
    ShellRegister("capabilities", 0x08, 32, ReadOnly),
    ShellRegister("frameSize", 0x0c, 32, ReadOnly)
  ) ++ (0 until 8).map(i => ShellRegister(s"formatHash[$i]", 0x10 + 4 * i, 32, ReadOnly)) ++ Seq(
    ShellRegister("control", 0x40, 3, WriteOnly),
    ShellRegister("status", 0x44, 4, ReadOnly),
    ShellRegister("interrupt.status", 0x48, Interrupts.count, ReadWrite),
    ShellRegister("interrupt.enable", 0x4c, Interrupts.count, ReadWrite),
    ShellRegister("interrupt.test", 0x50, Interrupts.count, WriteOnly),
    ShellRegister("framebuffer.errors", 0x54, FramebufferError.count, ReadOnly),
    ShellRegister("image.errors", 0x58, ImageError.count, ReadOnly),
    ShellRegister("framebuffer.base", 0x80, byteAddress, ReadWrite),
    ShellRegister("framebuffer.windowBase", 0x88, byteAddress, ReadWrite),
    ShellRegister("framebuffer.windowEnd", 0x90, byteAddress, ReadWrite),
    ShellRegister("framebuffer.stride", 0x98, 24, ReadWrite),
    ShellRegister("framebuffer.format", 0x9c, PixelFormat.getWidth, ReadWrite),
    ShellRegister("image.base", 0xc0, byteAddress, ReadWrite),
    ShellRegister("image.windowBase", 0xc8, byteAddress, ReadWrite),
    ShellRegister("image.windowEnd", 0xd0, byteAddress, ReadWrite),
    ShellRegister("image.bytes", 0xd8, 32, ReadWrite),
    ShellRegister("photo.base", 0xe0, byteAddress, ReadWrite),
    ShellRegister("photo.windowBase", 0xe8, byteAddress, ReadWrite),
    ShellRegister("photo.windowEnd", 0xf0, byteAddress, ReadWrite),
    ShellRegister("photo.stride", 0xf8, 24, ReadWrite),
    ShellRegister("photo.enabled", 0xfc, 1, ReadWrite)
  )

  /** What the design can do: bits 0 to 7 for a driver, and the base-2 logarithm of the bus bytes in bits 11 to 8. */
  def capabilities(config: ColonnadeConfig, busBytes: Int): BigInt = {
    val flags = Seq(
      config.hasEnvironment,
      config.columnBvhMemory.cache.nonEmpty,
      config.frame.hasBounces,
      config.geometry.cornerColours,
      config.geometry.texture.nonEmpty
    )
    val bits = flags.zipWithIndex.collect { case (true, bit) => 1 << bit }.sum
    BigInt(bits | (Integer.numberOfTrailingZeros(busBytes) << 8))
  }

  def frameSize(config: ColonnadeConfig): BigInt = BigInt(config.frame.maxWidth) | BigInt(config.frame.maxHeight) << 16

  /** The manifest's format hash as eight words; the first has its first eight digits. */
  def formatHash(config: ColonnadeConfig): Seq[BigInt] =
    Manifest(config)("formatHash").str.grouped(8).map(BigInt(_, 16)).toSeq

  /** `shell.json`, for drivers and test benches. */
  def json(config: ColonnadeConfig, busBytes: Int): String = Json.pretty(
    ujson.Obj(
      "version"    -> version.toInt,
      "busBytes"   -> busBytes,
      "deviceBase" -> deviceBase,
      "registers"  -> ujson.Arr.from(registers.map { register =>
        ujson.Obj(
          "name"    -> register.name,
          "address" -> register.address,
          "width"   -> register.width,
          "access"  -> register.access.label
        )
      }),
      "interrupts"        -> ujson.Arr.from(Interrupts.names),
      "framebufferErrors" -> ujson.Arr.from(FramebufferError.names),
      "imageErrors"       -> ujson.Arr.from(ImageError.names)
    )
  )

  /** Words of the device's registers that may be written, without `control.start`: the shell starts frames. */
  def writableWords(config: ColonnadeConfig): Seq[Int] =
    RegisterMap(config)
      .filter(register => register.access != Access.ReadOnly && register.name != "control.start")
      .flatMap(register => register.address until register.address + register.words)
}
