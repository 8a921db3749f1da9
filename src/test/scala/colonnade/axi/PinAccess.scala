package colonnade.axi

import chisel3._
import chiseltest._

/** Reads and drives pins by their names. */
class PinAccess(pins: AxiPins) {
  protected def has(name: String): Boolean = pins.elements.contains(name)

  protected def peek(name: String): BigInt = pins.elements(name) match {
    case bool: Bool => bool.peekInt()
    case bits       => bits.asInstanceOf[UInt].peekInt()
  }

  protected def poke(name: String, value: BigInt): Unit = pins.elements(name) match {
    case bool: Bool => bool.poke(value != 0)
    case bits       => bits.asInstanceOf[UInt].poke(value)
  }

  protected def isHigh(name: String): Boolean = peek(name) == 1

  /** Names of a channel's valid and payload, in alphabetical order. */
  protected def sent(channel: String): Seq[String] =
    pins.elements.keys.filter(name => name.startsWith(channel) && name != s"${channel}ready").toSeq.sorted
}
