package colonnade

import chisel3.Module
import chiseltest._
import colonnade.axi.AxiMemory
import colonnade.bus._
import colonnade.config.{ColonnadeConfig, ShellConfig}
import colonnade.formats.{RecordFormats, RegisterMap}
import org.scalatest.Assertions._

import scala.util.Random

/** A simulated shell with a memory, and its driver.
  *
  * @param stall of the memory
  */
class ShellBench(
    dut:        Module with ShellPins,
    config:     ColonnadeConfig,
    shell:      ShellConfig,
    val random: Random,
    stall:      Int = 50
) {
  val memory            = new AxiMemory(dut.masterPins, shell.busBytes, random, stall)
  val host              = new AxiLiteHost(dut.registerPins, random, () => cycle())
  private val registers = RegisterMap(config).map(register => register.name -> register).toMap

  dut.clock.setTimeout(0)

  /** Of the refit unit. */
  val refits = dut.refitPins.map(new AxiMemory(_, shell.busBytes, random))

  def cycle(): Unit = {
    (memory +: refits.toSeq).foreach(_.cycle())
    dut.clock.step()
  }

  def interrupt: Boolean = dut.interrupt.peekBoolean()

  /** Writes a register of the device. */
  def write(name: String, value: BigInt): Unit = {
    val register = registers(name)
    for (word <- 0 until register.words) {
      val address = ShellMap.deviceBase + 4 * (register.address + word)
      assert(host.write(address, (value >> (32 * word)) & 0xffffffffL), s"writing $name")
    }
  }

  def read(name: String): BigInt = {
    val register = registers(name)
    (0 until register.words).map { word =>
      host(ShellMap.deviceBase + 4 * (register.address + word)) << (32 * word)
    }.sum
  }

  def size(width: Int, height: Int): Unit = {
    for (name <- Seq("frame.width", "frame.objectRect.x1")) write(name, width)
    for (name <- Seq("frame.height", "frame.objectRect.y1")) write(name, height)
  }

  /** A device image with the scene's records. */
  def image(records: Seq[BigInt]): Vector[BigInt] = {
    val words = new RecordFormats(config).recordBits / 32
    val body  = Seq(BigInt(0), BigInt(records.size), BigInt(0), BigInt(0)) ++
      records.flatMap(record => (0 until words).map(word => (record >> (32 * word)) & 0xffffffffL))
    val padded = body.padTo((body.size + 31) / 32 * 32, BigInt(0))
    val header = (ImageHeader.expected(config) :+ BigInt(1)).padTo(32, BigInt(0))
      .updated(ImageHeader.bytesWord, BigInt(4 * (32 + padded.size)))
    (header ++ padded).toVector
  }

  /** Loads an image at an address in a window; returns the names of errors. */
  def load(image: Seq[BigInt], at: BigInt = 0x10000, window: Option[(BigInt, BigInt)] = None): Set[String] = {
    memory.store(at, image)
    val (first, end) = window.getOrElse((at, at + 4 * image.size))
    host.set("image.base", at)
    host.set("image.bytes", 4 * image.size)
    host.set("image.windowBase", first)
    host.set("image.windowEnd", end)
    host.set("control", 2)
    until("imageDone")
    names(host("image.errors"), ShellMap.bitsOf("image.errors"))
  }

  def framebuffer(base: BigInt, stride: Int, format: Int, window: (BigInt, BigInt)): Unit = {
    host.set("framebuffer.base", base)
    host.set("framebuffer.stride", stride)
    host.set("framebuffer.format", format)
    host.set("framebuffer.windowBase", window._1)
    host.set("framebuffer.windowEnd", window._2)
  }

  def framebufferErrors: Set[String] = names(host("framebuffer.errors"), ShellMap.bitsOf("framebuffer.errors"))

  /** Waits for an event and clears its interrupt; returns the other ones. */
  def until(event: String, most: Int = 20000): Set[String] = {
    host.set("interrupt.enable", 1 << Interrupts.names.indexOf(event))
    var cycles = 0
    while (!interrupt) {
      cycle()
      cycles += 1
      assert(cycles < most, s"no $event")
    }
    val status = host("interrupt.status")
    host.set("interrupt.status", status)
    names(status, Interrupts.names)
  }

  private def names(bits: BigInt, all: Seq[String]): Set[String] =
    all.zipWithIndex.collect { case (name, bit) if bits.testBit(bit) => name }.toSet
}
