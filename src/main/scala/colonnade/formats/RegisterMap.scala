package colonnade.formats

import chisel3._
import colonnade.config.{ColonnadeConfig, NumberFormats}

/** The access of the host to a register. */
sealed abstract class Access(val label: String)

object Access {
  case object ReadWrite extends Access("rw")
  case object ReadOnly  extends Access("ro")
  case object WriteOnly extends Access("wo")
}

/** A number behind the register port.
  *
  * @param address word address of its lowest 32 bits
  * @param words   number of consecutive words, low word first
  * @param limit   maximum value in the device, see [[RegisterLimits]]; None if all values are legal
  * @param hasReset a reset clears it
  */
final case class Register(
    name:     String,
    address:  Int,
    words:    Int,
    width:    Int,
    signed:   Boolean,
    access:   Access,
    limit:    Option[BigInt],
    hasReset: Boolean
)

/** Addresses of all registers. Each number starts at its own word.
  *
  * A kind of register has a block at a fixed address. Commands, status, errors and counters have the same addresses in
  * every design, whichever of them it has: a new one is declared last, and moves no other. Words without a register
  * read as 0.
  */
object RegisterMap {
  val dataBits: Int = 32 // of a word

  /** A kind of register.
    *
    * @param base     its first word
    * @param numbers  a design's
    * @param isCommon each has the same address in every design
    */
  private case class Block(base: Int, access: Access, numbers: ColonnadeConfig => Seq[Field], isCommon: Boolean = true)

  private def named(name: String, kind: Data): Seq[Field] =
    Layout.of(kind).map(field => field.copy(name = s"$name.${field.name}"))

  private val blocks = Seq(
    Block(0, Access.WriteOnly, config => named("control", new Control(config))),
    Block(6, Access.WriteOnly, ofRays(_ => named("rays", new RayCommands)), isCommon = false),
    Block(8, Access.ReadOnly, _ => named("status", new Status)),
    Block(12, Access.ReadOnly, ofRays(_ => named("rays", new RayProgress)), isCommon = false),
    Block(
      16,
      Access.ReadOnly,
      config => named("errors", if (config.queries.nonEmpty) new RayErrors(config) else new Errors(config))
    ),
    Block(28, Access.ReadOnly, ofRays(config => named("errors", new RayErrors(config)).takeRight(1)), isCommon = false),
    Block(
      32,
      Access.ReadOnly,
      config => named("counters", if (config.queries.nonEmpty) new RayCounters(config) else new Counters(config))
    ),
    Block(
      192,
      Access.ReadOnly,
      ofRays(config => named("counters", new RayCounters(config)).takeRight(2)),
      isCommon = false
    ),
    Block(256, Access.ReadWrite, config => Layout.of(settings(config)), isCommon = false)
  )

  /** Registers that the host writes before a frame, or a batch. */
  def settings(config: ColonnadeConfig): Data =
    if (config.queries.nonEmpty) new RayRegisters(config) else new FrameRegisters(config)

  /** Registers that the host writes while batches run. */
  def commands(config: ColonnadeConfig): Option[RayCommands] = config.queries.map(_ => new RayCommands)

  private def ofRays(numbers: ColonnadeConfig => Seq[Field])(config: ColonnadeConfig): Seq[Field] =
    if (config.queries.nonEmpty) numbers(config) else Nil

  def apply(config: ColonnadeConfig): Seq[Register] = {
    val limits = RegisterLimits(config)
    for {
      block <- blocks
      present = block.numbers(config).map(_.name).toSet
      (number, address) <- placed(block, config)
      if present(number.name)
    } yield Register(
      number.name,
      address,
      words(number),
      number.width,
      number.signed,
      block.access,
      limits.get(number.name),
      number.hasReset
    )
  }

  /** Total number of words. */
  def size(registers: Seq[Register]): Int = registers.map(r => r.address + r.words).max

  private def placed(block: Block, config: ColonnadeConfig): Seq[(Field, Int)] = {
    val numbers   = block.numbers(if (block.isCommon) ColonnadeConfig.complete else config)
    val addresses = numbers.scanLeft(block.base)(_ + words(_))
    require(
      blocks.map(_.base).filter(_ > block.base).forall(_ >= addresses.last),
      s"the block at ${block.base} is full"
    )
    numbers.zip(addresses)
  }

  private def words(number: Field): Int = (number.width + dataBits - 1) / dataBits
}

/** The maximum legal value of each register that can hold larger ones. The host reads back what it wrote; the device
  * uses the limit instead of larger values. Other registers may have any value; docs/errors.md.
  */
object RegisterLimits {

  /** By register name; all of them are unsigned. */
  def apply(config: ColonnadeConfig): Map[String, BigInt] = {
    val numbers   = config.numbers
    val one       = BigInt(1) << NumberFormats.lightFraction
    val materials = (0 until config.frame.materials).flatMap { index =>
      Seq(s"materials[$index].kind" -> MaterialKind.last(config), s"materials[$index].reflectance" -> one)
    }
    val limits = Seq(
      "frame.unitShift"             -> BigInt(numbers.maxUnitShift),
      "camera.stepShift"            -> BigInt(numbers.coordinateBits),
      "shading.lights"              -> BigInt(config.frame.lights),
      "shading.bounces"             -> BigInt(config.frame.maxBounces),
      "shading.shadowTransmittance" -> one,
      "gather.bounces"              -> BigInt(Gather.maxBounces),
      "scene.recordCount"           -> BigInt(config.columnBvhMemory.depth),
      "scene.instances"             -> BigInt(config.frame.instances)
    ) ++ materials
    val max = Layout.of(RegisterMap.settings(config)).map(field => field.name -> ((BigInt(1) << field.width) - 1)).toMap
    limits.filter { case (name, limit) => max.get(name).exists(limit < _) }.toMap
  }

  /** The value, clamped to the limit of its register. */
  def clamp(value: UInt, limit: Option[BigInt]): UInt =
    limit.fold(value)(max => Mux(value > max.U, max.U(value.getWidth.W), value))
}
