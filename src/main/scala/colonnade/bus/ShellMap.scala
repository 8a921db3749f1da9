package colonnade.bus

import chisel3.Bundle
import chisel3.util.log2Ceil
import colonnade.axi.AxiLite
import colonnade.config.{ColonnadeConfig, ShellConfig}
import colonnade.formats.{Access, Field, Json, Layout, Manifest, RegisterMap}
import colonnade.refit.{RefitErrors, RefitPlan}

/** A register of the shell.
  *
  * @param address     byte address of its low word
  * @param width       bits; beyond 32 in two words
  * @param description one sentence, for register pages and headers
  * @param fields      its parts by name, offset and width; none if it is one number
  */
final case class ShellRegister(
    name:        String,
    address:     Int,
    width:       Int,
    access:      Access,
    description: String,
    fields:      Seq[Field] = Nil
) {
  def words: Int = (width + AxiLite.dataBits - 1) / AxiLite.dataBits
}

/** Byte addresses of AXI4-Lite: the shell's registers, at the same address in every design that has them, and of the
  * device.
  */
object ShellMap {
  import Access.{ReadOnly, ReadWrite, WriteOnly}

  val addressBits: Int    = 16
  val deviceBase:  Int    = 0x8000     // word 0 of the device's [[colonnade.formats.RegisterMap]]
  val identity:    BigInt = 0x434c4e44 // "CLND"

  /** Major and minor version of these registers. A driver refuses another major version. */
  val version: BigInt = 0x00010004

  private val byteAddress = 40 // bits

  private val features =
    Seq("environment", "sceneInDram", "mirrorsAndGlass", "cornerColours", "textures", "pixelStream", "refit", "rays")
  private val capabilityFields = bits(features) :+ Field("busBytesLog2", 8, 4, signed = false, fraction = 0)

  val registers: Seq[ShellRegister] = Seq(
    ShellRegister("identity", 0x00, 32, ReadOnly, "0x434C4E44, \"CLND\"."),
    ShellRegister("version", 0x04, 32, ReadOnly, "Version of these registers.", halves("minor", "major")),
    ShellRegister("capabilities", 0x08, 32, ReadOnly, "What the design can do.", capabilityFields),
    ShellRegister("frameSize", 0x0c, 32, ReadOnly, "The largest frame, pixels.", halves("width", "height"))
  ) ++ (0 until 8).map { i =>
    val digits = s"Digits ${8 * i} to ${8 * i + 7} of the manifest's formatHash."
    ShellRegister(s"formatHash[$i]", 0x10 + 4 * i, 32, ReadOnly, digits)
  } ++ Seq(
    ShellRegister("control", 0x40, 3, WriteOnly, "One command.", fieldsOf(new ShellCommands)),
    ShellRegister("status", 0x44, 4, ReadOnly, "State of the shell.", fieldsOf(new ShellStatus)),
    interrupt("status", 0x48, ReadWrite, "Events; a written 1 clears its bit."),
    interrupt("enable", 0x4c, ReadWrite, "Events that raise irq."),
    interrupt("test", 0x50, WriteOnly, "A written 1 sets the bit of interrupt.status."),
    errors("framebuffer", 0x54, new FramebufferError, "Errors of the last frame that has ended."),
    errors("image", 0x58, new ImageError, "Errors of the last load."),
    setting("framebuffer.base", 0x80, byteAddress, "Address of the pixel (0, 0)."),
    setting("framebuffer.windowBase", 0x88, byteAddress, "No frame is written below this address."),
    setting("framebuffer.windowEnd", 0x90, byteAddress, "No frame is written from this address on."),
    setting("framebuffer.stride", 0x98, 24, "Bytes from a line to the next."),
    setting("framebuffer.format", 0x9c, PixelFormat.getWidth, "0: XRGB8888, 1: RGB565, 2: linear, 16 bits."),
    setting("image.base", 0xc0, byteAddress, "Address of the image."),
    setting("image.windowBase", 0xc8, byteAddress, "No image is read below this address."),
    setting("image.windowEnd", 0xd0, byteAddress, "No image is read from this address on."),
    setting("image.bytes", 0xd8, 32, "Size of the image, bytes."),
    setting("photo.base", 0xe0, byteAddress, "Address of the photo's pixel (0, 0)."),
    setting("photo.windowBase", 0xe8, byteAddress, "No photo is read below this address."),
    setting("photo.windowEnd", 0xf0, byteAddress, "No photo is read from this address on."),
    setting("photo.stride", 0xf8, 24, "Bytes from a line of the photo to the next."),
    setting("photo.enabled", 0xfc, 1, "1: the photo shows where the object does not."),
    setting("stream.enabled", 0x100, 1, "1: frames go to the pixel stream, not to the framebuffer."),
    setting("photo.hasStrengths", 0x104, 1, "1: the photo's highest bytes are strengths of the shadow."),
    ShellRegister("refit.control", 0x120, 1, WriteOnly, "1 starts a refit."),
    ShellRegister("refit.status", 0x124, 1, ReadOnly, "1: a refit runs."),
    errors("refit", 0x128, new RefitErrors, "Errors of the last refit."),
    ShellRegister("refit.flatPairs", 0x12c, RefitPlan.countBits, ReadOnly, "Pairs without normals of the last refit."),
    setting("refit.plan", 0x150, byteAddress, "Address of the plan."),
    setting("refit.vertices", 0x158, byteAddress, "Address of the vertices."),
    setting("refit.records", 0x160, byteAddress, "Address of the root's record."),
    setting("refit.entries", 0x168, RefitPlan.countBits, "Entries of the plan."),
    setting("refit.lines", 0x16c, RefitPlan.countBits, "Lines of vertices."),
    setting("refit.count", 0x170, RefitPlan.countBits, "Records of the mesh."),
    setting("refit.root", 0x174, RefitPlan.countBits, "The root's address in the scene.")
  ) ++ (0 until 6).map { i =>
    ShellRegister(
      s"refit.bounds[$i]",
      0x130 + 4 * i,
      RefitPlan.countBits,
      ReadOnly,
      "Bounds: low x, y, z, high x, y, z."
    )
  } ++ Seq(
    setting("rays.windowBase", 0x178, byteAddress, "No batch reads or writes below this address."),
    setting("rays.windowEnd", 0x180, byteAddress, "No batch reads or writes from this address on.")
  )

  /** The registers of a design: of frames, or of rays. */
  def of(config: ColonnadeConfig, shell: ShellConfig): Seq[ShellRegister] = {
    val ofFrames = Seq("framebuffer", "photo", "stream")
    val absent   =
      (if (config.queries.nonEmpty) ofFrames else Seq("rays")) ++ Option.unless(shell.refit)("refit")
    registers.filterNot(register => absent.contains(register.name.takeWhile(_ != '.'))).map {
      case register if register.name.startsWith("interrupt.") => register.copy(width = Interrupts.of(shell).size)
      case register                                           => register
    }
  }

  /** Whether a design has the registers of a part, by what precedes their dot. */
  def has(part: String, config: ColonnadeConfig, shell: ShellConfig): Boolean =
    of(config, shell).exists(_.name.startsWith(s"$part."))

  /** Names of a register's parts, the lowest first. */
  def bitsOf(register: String): Seq[String] = registers.filter(_.name == register).flatMap(_.fields).map(_.name)

  private def interrupt(name: String, address: Int, access: Access, description: String): ShellRegister =
    ShellRegister(s"interrupt.$name", address, Interrupts.names.size, access, description, bits(Interrupts.names))

  private def errors(of: String, address: Int, bits: Bundle, description: String): ShellRegister =
    ShellRegister(s"$of.errors", address, bits.getWidth, ReadOnly, description, fieldsOf(bits))

  private def setting(name: String, address: Int, width: Int, description: String): ShellRegister =
    ShellRegister(name, address, width, ReadWrite, description)

  private def fieldsOf(bundle: Bundle): Seq[Field] = Layout.of(bundle).sortBy(_.offset)

  /** A bit for each name, from bit 0 on. */
  private def bits(names: Seq[String]): Seq[Field] =
    names.zipWithIndex.map { case (name, offset) => Field(name, offset, 1, signed = false, fraction = 0) }

  /** The low and the high half of a word. */
  private def halves(low: String, high: String): Seq[Field] =
    Seq(Field(low, 0, 16, signed = false, fraction = 0), Field(high, 16, 16, signed = false, fraction = 0))

  /** What the design can do: bits 0 to 7 for a driver, and the base-2 logarithm of the bus bytes in bits 11 to 8. */
  def capabilities(config: ColonnadeConfig, shell: ShellConfig): BigInt = {
    val flags = Seq(
      config.hasEnvironment,
      config.columnBvhMemory.cache.nonEmpty,
      config.frame.hasBounces,
      config.geometry.cornerColours,
      config.geometry.texture.nonEmpty,
      shell.pixelStream,
      shell.refit,
      config.queries.nonEmpty
    )
    require(flags.size == features.size)
    val mask = flags.zipWithIndex.collect { case (true, bit) => 1 << bit }.sum
    BigInt(mask | (Integer.numberOfTrailingZeros(shell.busBytes) << 8))
  }

  /** 0 of a device for rays. */
  def frameSize(config: ColonnadeConfig): BigInt =
    if (config.queries.nonEmpty) 0 else BigInt(config.frame.maxWidth) | BigInt(config.frame.maxHeight) << 16

  /** The manifest's format hash as eight words; the first has its first eight digits. */
  def formatHash(config: ColonnadeConfig): Seq[BigInt] =
    Manifest(config)("formatHash").str.grouped(8).map(BigInt(_, 16)).toSeq

  /** `shell.json`, for drivers and test benches. */
  def json(config: ColonnadeConfig, shell: ShellConfig): String = Json.pretty(
    ujson.Obj(
      "version"      -> version.toInt,
      "busBytes"     -> shell.busBytes,
      "deviceBase"   -> deviceBase,
      "postedWrites" -> postedWrites(config),
      "registers"    -> ujson.Arr.from(registers.map { register =>
        ujson.Obj(
          "name"        -> register.name,
          "address"     -> register.address,
          "width"       -> register.width,
          "access"      -> register.access.label,
          "description" -> register.description,
          "fields"      -> ujson.Arr.from(register.fields.map { field =>
            ujson.Obj("name" -> field.name, "offset" -> field.offset, "width" -> field.width)
          })
        )
      }),
      "interrupts"        -> ujson.Arr.from(Interrupts.names),
      "framebufferErrors" -> ujson.Arr.from(bitsOf("framebuffer.errors")),
      "imageErrors"       -> ujson.Arr.from(bitsOf("image.errors"))
    )
  )

  /** Writes to the device's registers that the shell takes while a frame runs: at least one of each word, and 256.
    * Those of a device for rays do not wait.
    */
  def postedWrites(config: ColonnadeConfig): Int =
    if (config.queries.nonEmpty) 2 else (1 << log2Ceil(writableWords(config).size)).max(256)

  /** Words of the device's registers that may be written, without `control.start` where the shell starts frames. */
  def writableWords(config: ColonnadeConfig): Seq[Int] =
    RegisterMap(config)
      .filter(_.access != Access.ReadOnly)
      .filter(register => config.queries.nonEmpty || register.name != "control.start")
      .flatMap(register => register.address until register.address + register.words)
}
