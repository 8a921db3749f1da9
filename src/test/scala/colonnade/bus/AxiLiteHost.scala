package colonnade.bus

import colonnade.axi.{AxiPins, PinAccess}
import org.scalatest.Assertions._

import scala.util.Random

/** A driver at the pins of an AXI4-Lite slave, with random delays on each channel.
  *
  * @param cycle steps the clock
  */
class AxiLiteHost(pins: AxiPins, random: Random, cycle: () => Unit) extends PinAccess(pins) {
  for (channel <- Seq("aw", "w", "ar")) poke(s"${channel}valid", 0)
  for (channel <- Seq("b", "r")) poke(s"${channel}ready", 0)

  /** Returns whether the slave answers without an error. */
  def write(address: Int, data: BigInt, strobes: Int = 15): Boolean = {
    poke("awaddr", address)
    poke("wdata", data)
    poke("wstrb", strobes)
    transfer(Set("aw", "w"), "b")
    peek("bresp") == 0
  }.tap(_ => finish("b"))

  /** The word and whether the slave answers without an error. */
  def read(address: Int): (BigInt, Boolean) = {
    poke("araddr", address)
    transfer(Set("ar"), "r")
    (peek("rdata"), peek("rresp") == 0)
  }.tap(_ => finish("r"))

  def apply(address: Int): BigInt = {
    val (word, isOkay) = read(address)
    assert(isOkay, f"reading $address%x")
    word
  }

  def apply(name: String): BigInt = apply(ShellMap.registers.find(_.name == name).get.address)

  def set(name: String, value: BigInt): Unit = {
    val register = ShellMap.registers.find(_.name == name).get
    for (word <- 0 until register.words)
      assert(write(register.address + 4 * word, (value >> (32 * word)) & 0xffffffffL), s"writing $name")
  }

  private implicit class Tap[T](value: T) {
    def tap(effect: T => Unit): T = { effect(value); value }
  }

  private def transfer(channels: Set[String], answer: String): Unit = {
    var left    = channels
    var offered = Set.empty[String]
    var cycles  = 0
    while (left.nonEmpty || peek(s"${answer}valid") == 0) {
      for (channel <- left if !offered(channel) && random.nextInt(3) > 0) {
        poke(s"${channel}valid", 1)
        offered += channel
      }
      val accepted = offered.filter(channel => peek(s"${channel}ready") == 1)
      cycle()
      accepted.foreach(channel => poke(s"${channel}valid", 0))
      left --= accepted
      offered --= accepted
      cycles += 1
      assert(cycles < 1000, "the slave does not answer")
    }
  }

  /** Lets the answer wait for a while; it holds. */
  private def finish(answer: String): Unit = {
    val before = sent(answer).map(peek)
    for (_ <- 0 until random.nextInt(4)) {
      cycle()
      assert(sent(answer).map(peek) == before, s"$answer did not hold")
    }
    poke(s"${answer}ready", 1)
    cycle()
    poke(s"${answer}ready", 0)
    assert(peek(s"${answer}valid") == 0)
  }
}
