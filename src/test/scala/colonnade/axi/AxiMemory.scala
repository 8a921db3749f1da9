package colonnade.axi

import org.scalatest.Assertions._

import scala.collection.mutable
import scala.util.Random

/** When a memory takes the address and the data of a write; AXI4 allows all of these. */
object WriteOrder extends Enumeration {
  val any, addressAfterDataValid, dataAfterAddress, together, addressAfterLastBeat = Value
}

/** A memory at the pins of an AXI4 master, with random stalls and latencies. Checks that each valid holds with its
  * payload until it is accepted, that no data are offered before their address, that bursts end with `last` and cross
  * no 4 KB.
  *
  * @param stall percentage of cycles in which a channel does not move
  * @param order of the writes
  */
class AxiMemory(
    pins:     AxiPins,
    busBytes: Int,
    random:   Random,
    stall:    Int = 50,
    order:    WriteOrder.Value = WriteOrder.any
) extends PinAccess(pins) {
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
  private val data    = mutable.Queue.empty[Beat]  // without their address
  private val answers = mutable.Queue.empty[Burst]
  private val reads   = mutable.Queue.empty[Burst]
  private val held    = mutable.Map.empty[String, Seq[BigInt]]
  private var beat    = 0                          // of the first write
  private var offered = Set.empty[String]
  private var now     = 0

  private var announced   = 0     // addresses that have been offered
  private var isAnnounced = false // the one that is offered now is among them
  private var begunBursts = 0     // of data that have been offered
  private var isFirstBeat = true

  private def moves(): Boolean = random.nextInt(100) >= stall

  /** The bytes of a range, which must all have been written. */
  def dump(address: BigInt, size: Int): Seq[Int] = (0 until size).map(i => bytes(address + i))

  /** The words of a range. */
  def words(address: BigInt, count: Int): Seq[BigInt] =
    dump(address, 4 * count).grouped(4).map(_.zipWithIndex.map { case (byte, i) => BigInt(byte) << (8 * i) }.sum).toSeq

  def store(address: BigInt, words: Seq[BigInt]): Unit =
    for ((word, index) <- words.zipWithIndex; byte <- 0 until 4) {
      bytes(address + 4 * index + byte) = ((word >> (8 * byte)) & 255).toInt
    }

  def isIdle: Boolean = writes.isEmpty && data.isEmpty && answers.isEmpty && reads.isEmpty

  /** One cycle of the memory: pokes and peeks the pins; the caller steps the clock. */
  def cycle(): Unit = {
    for ((channel, isReady) <- readies if has(s"${channel}valid"))
      poke(s"${channel}ready", if (isReady && !isSilent) 1 else 0)
    offer("b", answers.headOption) { burst =>
      poke("bid", burst.id)
      poke("bresp", response(burst.address))
    }
    offer("r", reads.headOption) { burst =>
      val at = burst.address / busBytes * busBytes + burst.sent * busBytes
      poke("rid", burst.id)
      poke("rdata", (0 until busBytes).map(i => BigInt(bytes.getOrElse(at + i, 0xee)) << (8 * i)).sum)
      poke("rresp", response(burst.address))
      poke("rlast", if (burst.sent == burst.beats - 1) 1 else 0)
    }
    for (channel <- Seq("aw", "w", "ar") if has(s"${channel}valid")) watch(channel)
    if (has("awvalid")) checkOrder()
    if (fires("aw")) writes.enqueue(burst("aw"))
    if (fires("w")) data.enqueue(Beat(peek("wdata"), peek("wstrb"), peek("wlast") == 1))
    while (writes.nonEmpty && data.nonEmpty) write(data.dequeue())
    if (fires("ar")) {
      val next = burst("ar")
      reads += next
      for (i <- 0 until next.beats * busBytes) read += next.address + i
    }
    if (fires("b")) {
      answers.dequeue()
      overtake(answers)
    }
    if (fires("r")) {
      reads.head.sent += 1
      if (reads.head.sent == reads.head.beats) reads.dequeue()
      overtake(reads)
    }
    now += 1
  }

  /** Makes the first burst of any id the next one: beats of different ids come between each other. */
  private def overtake(bursts: mutable.Queue[Burst]): Unit = {
    val firsts = bursts.groupBy(_.id).values.map(_.head).toSeq.sortBy(_.id)
    if (firsts.size > 1) {
      val next = firsts(random.nextInt(firsts.size))
      bursts -= next
      bursts.prepend(next)
    }
  }

  /** Which channels the memory takes from in this cycle. */
  private def readies: Map[String, Boolean] = {
    def offers(channel: String) = has(s"${channel}valid") && isHigh(s"${channel}valid")
    val (aw, w)                 = order match {
      case WriteOrder.any                   => (moves(), moves())
      case WriteOrder.addressAfterDataValid => (moves() && (offers("w") || data.nonEmpty), moves())
      case WriteOrder.dataAfterAddress      => (moves(), moves() && writes.nonEmpty)
      case WriteOrder.addressAfterLastBeat  => (moves() && data.exists(_.isLast), moves())
      case WriteOrder.together              =>
        val both = moves()
        (both && offers("w"), both && (offers("aw") || writes.nonEmpty))
    }
    Map("aw" -> aw, "w" -> w, "ar" -> moves())
  }

  /** No data are offered before their address is. */
  private def checkOrder(): Unit = {
    if (isHigh("awvalid") && !isAnnounced) announced += 1
    isAnnounced = isHigh("awvalid") && !fires("aw")
    if (isHigh("wvalid")) {
      if (isFirstBeat) begunBursts += 1
      isFirstBeat = false
      assert(begunBursts <= announced, "data before their address")
      if (fires("w") && peek("wlast") == 1) isFirstBeat = true
    }
  }

  private def fires(channel: String): Boolean =
    has(s"${channel}valid") && isHigh(s"${channel}valid") && isHigh(s"${channel}ready")

  private def burst(channel: String): Burst = {
    val (address, beats) = (peek(s"${channel}addr"), peek(s"${channel}len").toInt + 1)
    assert(peek(s"${channel}burst") == 1 && (1 << peek(s"${channel}size").toInt) == busBytes)
    val last = address / busBytes * busBytes + beats * busBytes - 1
    assert(address / 4096 == last / 4096, "a burst crosses 4 KB")
    bursts += beats
    Burst(peek(s"${channel}id"), address, beats, now + random.nextInt(maxDelay + 1))
  }

  private def write(taken: Beat): Unit = {
    val first = writes.head.address / busBytes * busBytes + beat * busBytes
    for (i <- 0 until busBytes if taken.strobes.testBit(i)) {
      bytes(first + i) = ((taken.data >> (8 * i)) & 255).toInt
      written += first + i
    }
    beat += 1
    assert(taken.isLast == (beat == writes.head.beats), "last")
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
    lazy val now = sent(channel).map(peek)
    held.remove(channel).foreach(before => assert(now == before, s"$channel did not hold"))
    if (peek(s"${channel}valid") == 1 && peek(s"${channel}ready") == 0) held(channel) = now
  }
}

/** A beat of a write. */
private final case class Beat(data: BigInt, strobes: BigInt, isLast: Boolean)

/** A burst, answered from cycle `due` on. */
private final case class Burst(id: BigInt, address: BigInt, beats: Int, due: Int) {
  var sent: Int = 0 // beats
}
