package colonnade.query

import chiseltest._
import colonnade.axi.{AxiReadPort, AxiWritePort}
import org.scalatest.Assertions._

import scala.collection.mutable
import scala.util.Random

/** A memory at a port for rays: bursts of different ids overtake each other, all channels stall at random. Checks that
  * bursts cross no 4 KB and are complete.
  *
  * @param stall    percentage of cycles in which a channel does not move
  * @param maxDelay cycles from an address to its response
  */
class RayMemory(read: AxiReadPort, write: AxiWritePort, random: Random, stall: Int, maxDelay: Int) {
  val bytes   = mutable.Map.empty[BigInt, Int]
  val written = mutable.Set.empty[BigInt]

  /** Addresses of beats whose read fails. */
  val broken = mutable.Set.empty[BigInt]
  var maxId  = 0

  private case class Pending(id: Int, address: BigInt, beats: Int, due: Int)
  private val reads     = mutable.ArrayBuffer.empty[Pending]
  private val responses = mutable.ArrayBuffer.empty[Pending]
  private var writes    = Option.empty[Pending] // the beats that are left
  private var reading   = Option.empty[Pending]
  private var response  = Option.empty[Pending]
  private var now       = 0

  def store(address: BigInt, words: Seq[BigInt]): Unit =
    for ((word, i) <- words.zipWithIndex; byte <- 0 until 4)
      bytes(address + 4 * i + byte) = ((word >> (8 * byte)) & 255).toInt

  def words(address: BigInt, count: Int): Seq[BigInt] =
    Seq.tabulate(count)(i => (0 until 4).map(byte => BigInt(bytes(address + 4 * i + byte)) << (8 * byte)).sum)

  /** One cycle; the caller steps the clock. */
  def cycle(): Unit = {
    val Seq(ar, aw, w) = Seq.fill(3)(random.nextInt(100) >= stall)
    read.ar.ready.poke(ar)
    write.aw.ready.poke(aw && writes.isEmpty)
    write.w.ready.poke(w)

    // Answers that are offered stay
    if (reading.isEmpty && random.nextInt(100) >= stall) reading = next(reads)
    read.r.valid.poke(reading.nonEmpty)
    for (burst <- reading) {
      val data = (0 until 64).map(i => BigInt(bytes.getOrElse(burst.address + i, 0xee)) << (8 * i)).sum
      read.r.bits.id.poke(burst.id)
      read.r.bits.data.poke(data)
      read.r.bits.resp.poke(if (broken(burst.address)) 2 else 0)
      read.r.bits.last.poke(burst.beats == 1)
    }
    if (response.isEmpty && random.nextInt(100) >= stall) response = next(responses)
    write.b.valid.poke(response.nonEmpty)
    for (burst <- response) {
      write.b.bits.id.poke(burst.id)
      write.b.bits.resp.poke(0)
    }

    // What is taken
    if (reading.nonEmpty && read.r.ready.peekBoolean()) {
      val burst = reading.get
      val rest  = burst.copy(address = burst.address + 64, beats = burst.beats - 1, due = now)
      reading = None
      if (rest.beats > 0) reads.insert(reads.indexWhere(_.id == rest.id).max(0).min(reads.size), rest)
    }
    if (response.nonEmpty && write.b.ready.peekBoolean()) response = None
    if (ar && read.ar.valid.peekBoolean()) reads += burstOf(read.ar.bits)
    if (write.w.valid.peekBoolean() && w) {
      val burst  = writes.getOrElse(fail("data before their address"))
      val strobe = write.w.bits.strb.peekInt()
      val data   = write.w.bits.data.peekInt()
      for (i <- 0 until 64 if strobe.testBit(i)) {
        bytes(burst.address + i) = ((data >> (8 * i)) & 255).toInt
        written += burst.address + i
      }
      assert(write.w.bits.last.peekBoolean() == (burst.beats == 1), "last")
      writes = Some(burst.copy(address = burst.address + 64, beats = burst.beats - 1)).filter(_.beats > 0)
      if (writes.isEmpty) responses += burst.copy(due = now + 1 + random.nextInt(maxDelay + 1))
    } else if (aw && writes.isEmpty && write.aw.valid.peekBoolean()) writes = Some(burstOf(write.aw.bits))
    now += 1
  }

  /** The first response of any id that is due. */
  private def next(pending: mutable.ArrayBuffer[Pending]): Option[Pending] = {
    val firsts = pending.groupBy(_.id).values.map(_.head).filter(_.due <= now).toSeq.sortBy(_.id)
    Option.when(firsts.nonEmpty) {
      val oldest = firsts(random.nextInt(firsts.size))
      pending.remove(pending.indexWhere(_.id == oldest.id))
      oldest
    }
  }

  private def burstOf(port: colonnade.axi.AxiAddress): Pending = {
    val (address, beats) = (port.addr.peekInt(), port.len.peekInt().toInt + 1)
    val id               = port.id.peekInt().toInt
    assert(address % 64 == 0 && port.size.peekInt() == 6 && port.burst.peekInt() == 1)
    assert(address / 4096 == (address + 64 * beats - 1) / 4096, "a burst crosses 4 KB")
    maxId = maxId.max(id)
    Pending(id, address, beats, now + random.nextInt(maxDelay + 1))
  }
}
