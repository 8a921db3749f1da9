package colonnade.formats

import colonnade.config.ColonnadeConfig

/** How the host may use a register. */
sealed abstract class Access(val label: String)

object Access {
  case object ReadWrite extends Access("rw")
  case object ReadOnly  extends Access("ro")
  case object WriteOnly extends Access("wo")
}

/** A number behind the register port.
  *
  * @param address of its lowest 32 bits, in words
  * @param words   consecutive addresses it takes, low word first
  * @param limit   the greatest value that the device takes, see [[RegisterLimits]]; None: all that fit
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

/** Addresses of all registers, in the order of their declaration: control, status, errors, counters, then
  * [[FrameRegisters]]. Each number starts at a word of its own.
  */
object RegisterMap {

  /** Bits of a word. */
  val dataBits: Int = 32

  def apply(config: ColonnadeConfig): Seq[Register] = {
    val numbers = Seq(
      (new HostCommands, Access.WriteOnly),
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

  /** Words in all. */
  def size(registers: Seq[Register]): Int = registers.map(r => r.address + r.words).max
}
