package colonnade.bus

import colonnade.axi.AxiPins
import org.scalatest.Assertions._

import scala.collection.mutable
import scala.util.Random

/** A memory at the pins of an AXI4 master, with random stalls and latencies. Checks that each valid holds with its payload
  * until it is accepted, that bursts end with `last` and cross no 4 KB.
  *
  * @param stall percentage of cycles in which a channel does not move
  */
class AxiMemory(pins: AxiPins, busBytes: Int, random: Random, stall: Int = 50) extends PinAccess(pins) {
  val bytes    = mutable.Map.empty[BigInt, Int]
  val written  = mutable.Set.empty[BigInt]
  val read     = mutable.Set.empty[BigInt]
  var maxDelay = 20

  /** The answer to a burst that begins at an address. */
  var response: BigInt => Int = _ => 0

  /** The memory answers nothing. */
  var isSilent = false

  /** Beats of the bursts, in order. */
  val bursts = mutable.ArrayBuffer.empty[Int]

  private val writes  = mutable.Queue.empty[Burst] // addresses whose data are not complete
  private val answers = mutable.Queue.empty[Burst]
  private val reads   = mutable.Queue.empty[Burst]
  private val held    = mutable.Map.empty[String, Seq[BigInt]]
  private var beat    = 0                          // of the first write
  private var sent    = 0                          // of the first read
  private var offered = Set.empty[String]
  private var now     = 0

  private def moves(): Boolean = random.nextInt(100) >= stall

  /** The bytes of a range, which must all have been written. */
  def dump(address: BigInt, size: Int): Seq[Int] = (0 until size).map(i => bytes(address + i))

  def store(address: BigInt, words: Seq[BigInt]): Unit =
    for ((word, index) <- words.zipWithIndex; byte <- 0 until 4) {
      bytes(address + 4 * index + byte) = ((word >> (8 * byte)) & 255).toInt
    }

  def isIdle: Boolean = writes.isEmpty && answers.isEmpty && reads.isEmpty

  /** One cycle of the memory: pokes and peeks the pins; the caller steps the clock. */
  def cycle(): Unit = {
    for (channel <- Seq("aw", "w", "ar") if has(s"${channel}valid"))
      poke(s"${channel}ready", if (moves() && !isSilent) 1 else 0)
    offer("b", answers.headOption) { burst => poke("bresp", response(burst.address)) }
    offer("r", reads.headOption) { burst =>
      val at = burst.address / busBytes * busBytes + sent * busBytes
      poke("rdata", (0 until busBytes).map(i => BigInt(bytes.getOrElse(at + i, 0xee)) << (8 * i)).sum)
      poke("rresp", response(burst.address))
      poke("rlast", if (sent == burst.beats - 1) 1 else 0)
    }
    for (channel <- Seq("aw", "w", "ar") if has(s"${channel}valid")) watch(channel)
    if (fires("aw")) writes.enqueue(burst("aw"))
    if (fires("w")) write()
    if (fires("ar")) {
      val next = burst("ar")
      reads.enqueue(next)
      for (i <- 0 until next.beats * busBytes) read += next.address + i
    }
    if (fires("b")) answers.dequeue()
    if (fires("r")) {
      sent += 1
      if (sent == reads.head.beats) {
        sent = 0
        reads.dequeue()
      }
    }
    now += 1
  }

  private def fires(channel: String): Boolean =
    has(s"${channel}valid") && isHigh(s"${channel}valid") && isHigh(s"${channel}ready")

  private def burst(channel: String): Burst = {
    val (address, beats) = (peek(s"${channel}addr"), peek(s"${channel}len").toInt + 1)
    assert(peek(s"${channel}burst") == 1 && (1 << peek(s"${channel}size").toInt) == busBytes)
    val last = address / busBytes * busBytes + beats * busBytes - 1
    assert(address / 4096 == last / 4096, "a burst crosses 4 KB")
    bursts += beats
    Burst(address, beats, now + random.nextInt(maxDelay + 1))
  }

  private def write(): Unit = {
    assert(writes.nonEmpty, "data without an address")
    val first   = writes.head.address / busBytes * busBytes + beat * busBytes
    val strobes = peek("wstrb")
    val data    = peek("wdata")
    for (i <- 0 until busBytes if strobes.testBit(i)) {
      bytes(first + i) = ((data >> (8 * i)) & 255).toInt
      written += first + i
    }
    beat += 1
    assert((peek("wlast") == 1) == (beat == writes.head.beats), "last")
    if (beat == writes.head.beats) {
      beat = 0
      answers.enqueue(writes.dequeue().copy(due = now + 1 + random.nextInt(maxDelay + 1)))
    }
  }

  /** Offers an answer when it is due; then it holds until it is taken. */
  private def offer(channel: String, burst: Option[Burst])(payload: Burst => Unit): Unit =
    if (has(s"${channel}valid")) {
      val wasTaken = !offered(channel)
      val offers   = burst.exists(b => b.due <= now && (!wasTaken || moves())) && !isSilent
      poke(s"${channel}valid", if (offers) 1 else 0)
      if (offers) {
        payload(burst.get)
        offered += channel
        if (peek(s"${channel}ready") == 1) offered -= channel
      }
    }

  private def watch(channel: String): Unit = {
    val now = sent(channel).map(peek)
    held.remove(channel).foreach(before => assert(now == before, s"$channel did not hold"))
    if (peek(s"${channel}valid") == 1 && peek(s"${channel}ready") == 0) held(channel) = now
  }
}

/** A burst, answered from cycle `due` on. */
private final case class Burst(address: BigInt, beats: Int, due: Int)
