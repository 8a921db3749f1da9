package colonnade.query

import chisel3.{chiselTypeOf, Module}
import chisel3.util.log2Ceil
import chiseltest._
import colonnade.Simulation
import colonnade.axi.{Axi, AxiAddress, AxiMemory}
import colonnade.formats.RayBatch
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

private class RayPortHarness(count: Int) extends MemoryUnit(RayPort.idBits(count)) {
  private val port = Module(new RayPort(count)).io

  val reads  = IO(chiselTypeOf(port.reads))
  val writes = IO(chiselTypeOf(port.writes))
  port.reads :<>= reads
  port.writes :<>= writes
  attachHeld(port.read, port.write)
}

/** Masters share a port: each one gets what it has requested, in its order, and writes what it sends. */
class RayPortSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "RayPort"

  for (count <- Seq(1, 3))
    it should s"serve $count masters at a time" in
      test(new RayPortHarness(count)).withAnnotations(Simulation.verilator) { dut =>
        val random  = new Random(count)
        val memory  = new AxiMemory(dut.pins, RayBatch.bytes, random, stall = 30)
        val masters = Seq.tabulate(count)(new PortMaster(dut, memory, _, random))
        memory.response = address => Seq(0, 2, 3)((address / RayBatch.bytes % 3).toInt)
        dut.clock.setTimeout(0)
        var cycles = 0
        while (!masters.forall(_.isDone)) {
          masters.foreach(_.offer())
          memory.cycle()
          masters.foreach(_.take())
          dut.clock.step()
          cycles += 1
          cycles should be < 30000
        }
        memory.isIdle shouldBe true
        masters.foreach(_.check())
      }
}

/** Reads and writes bursts of any length, some at a time. */
private class PortMaster(dut: RayPortHarness, memory: AxiMemory, index: Int, random: Random) extends Matchers {
  private case class Burst(address: BigInt, beats: Int)
  private val read  = dut.reads(index)
  private val write = dut.writes(index)
  private val bytes = RayBatch.bytes

  /** In 4 KB of its own each. */
  private def bursts(base: Int) = mutable.Queue.tabulate(30) { i =>
    Burst(BigInt(base + 0x1000 * (32 * index + i)) + bytes * random.nextInt(32), 1 + random.nextInt(8))
  }
  private def word()            = BigInt(8 * bytes, random)
  private val toRead            = bursts(0x100000)
  private val toWrite           = bursts(0x800000)
  private val due               = mutable.Queue.empty[(BigInt, BigInt, Boolean)] // data, response, last
  private val responses         = mutable.Queue.empty[BigInt]                    // to writes
  private val beats             = mutable.Queue.empty[(BigInt, Boolean)]         // to send
  private val contents          = mutable.Map.empty[BigInt, BigInt]
  private var (asks, announces) = (false, false)

  for (burst <- toRead; beat <- 0 until burst.beats) {
    val value = word()
    memory.store(burst.address + bytes * beat, (0 until bytes / 4).map(i => (value >> (32 * i)) & 0xffffffffL))
    contents(burst.address + bytes * beat) = value
  }

  def isDone: Boolean = toRead.isEmpty && toWrite.isEmpty && due.isEmpty && responses.isEmpty && beats.isEmpty

  def offer(): Unit = {
    asks = toRead.nonEmpty && (asks || random.nextInt(4) == 0)
    read.ar.valid.poke(asks)
    if (asks) address(read.ar.bits, toRead.head)
    read.r.ready.poke(random.nextBoolean())
    announces = toWrite.nonEmpty && beats.isEmpty && (announces || random.nextInt(4) == 0)
    write.aw.valid.poke(announces)
    if (announces) address(write.aw.bits, toWrite.head)
    write.w.valid.poke(beats.nonEmpty)
    for ((data, isLast) <- beats.headOption) {
      write.w.bits.data.poke(data)
      write.w.bits.strb.poke((BigInt(1) << bytes) - 1)
      write.w.bits.last.poke(isLast)
    }
    write.b.ready.poke(random.nextBoolean())
  }

  def take(): Unit = {
    if (read.r.valid.peekBoolean() && read.r.ready.peekBoolean())
      (
        read.r.bits.data.peekInt(),
        read.r.bits.resp.peekInt(),
        read.r.bits.last.peekBoolean()
      ) shouldBe due.dequeue()
    if (asks && read.ar.ready.peekBoolean()) {
      val burst = toRead.dequeue()
      for (beat <- 0 until burst.beats)
        due += ((contents(burst.address + bytes * beat), memory.response(burst.address), beat + 1 == burst.beats))
      asks = false
    }
    if (write.b.valid.peekBoolean() && write.b.ready.peekBoolean())
      write.b.bits.resp.peekInt() shouldBe responses.dequeue()
    if (beats.nonEmpty && write.w.ready.peekBoolean()) beats.dequeue()
    if (announces && write.aw.ready.peekBoolean()) {
      val burst = toWrite.dequeue()
      responses += memory.response(burst.address)
      for (beat <- 0 until burst.beats) {
        contents(burst.address + bytes * beat) = word()
        beats += ((contents(burst.address + bytes * beat), beat + 1 == burst.beats))
      }
      announces = false
    }
  }

  /** All that was written lies where it belongs. */
  def check(): Unit = for ((address, value) <- contents)
    memory.words(address, bytes / 4) shouldBe (0 until bytes / 4).map(i => (value >> (32 * i)) & 0xffffffffL)

  private def address(port: AxiAddress, burst: Burst): Unit = {
    port.addr.poke(burst.address)
    port.len.poke(burst.beats - 1)
    port.size.poke(log2Ceil(bytes))
    port.burst.poke(Axi.incr)
  }
}
