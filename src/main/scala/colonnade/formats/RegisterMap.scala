package colonnade.formats

import colonnade.config.ColonnadeConfig

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
  */
final case class Register(
    name:    String,
    address: Int,
    words:   Int,
    width:   Int,
    signed:  Boolean,
    access:  Access,
    limit:   Option[BigInt]
)

/** Addresses of all registers, in order of declaration: control, status, errors, counters, then
  * [[FrameRegisters]]. Each number starts at its own word.
  */
object RegisterMap {

  /** Width of a word. */
  val dataBits: Int = 32

  def apply(config: ColonnadeConfig): Seq[Register] = {
    val numbers = Seq(
      (new HostCommands(config), Access.WriteOnly),
      (new DeviceStatus(config), Access.ReadOnly),
      (new FrameRegisters(config), Access.ReadWrite)
    ).flatMap { case (bundle, access) => Layout.of(bundle).map(_ -> access) }

    val limits    = RegisterLimits(config)
    val words     = numbers.map { case (number, _) => (number.width + dataBits - 1) / dataBits }
    val addresses = words.scanLeft(0)(_ + _)
    numbers.zip(words).zip(addresses).map { case (((number, access), count), address) =>
      Register(number.name, address, count, number.width, number.signed, access, limits.get(number.name))
    }
  }

  /** Total number of words. */
  def size(registers: Seq[Register]): Int = registers.map(r => r.address + r.words).max
}
