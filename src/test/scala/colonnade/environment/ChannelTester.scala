package colonnade.environment

import chisel3._
import chisel3.util.{Counter, Decoupled, Fill, Queue, RegEnable, Valid}
import chisel3.util.random.LFSR
import chiseltest._

import scala.collection.mutable
import scala.util.Random

/** A channel with one integer each way. The tag is in the low bits, a response's `isIllegal` in the highest bit. */
final class FlatChannel(reqBits: Int, respBits: Int, tagBits: Int) extends Bundle {
  val req  = Flipped(Decoupled(UInt((reqBits + tagBits).W)))
  val resp = Valid(UInt((respBits + tagBits).W))
}

object FlatChannel {

  /** The channels of a port, in the order of its fields. */
  def channels(port: AttributePort): Seq[AttributeChannel[_ <: Data, _ <: Data]] =
    Seq(port.albedo, port.normals, port.cells, port.planes)

  /** Ports for all channels of a port of the unit under test. */
  def all(port: AttributePort): Seq[FlatChannel] =
    Seq(FlatChannel(port.albedo), FlatChannel(port.normals), FlatChannel(port.cells), FlatChannel(port.planes))

  /** Ports for a channel of the unit under test. */
  def apply[Q <: Data, R <: Data](channel: AttributeChannel[Q, R]): FlatChannel = {
    val (req, resp) = (channel.req.bits, channel.resp.bits)
    val flat        = IO(new FlatChannel(req.content.getWidth, resp.getWidth - resp.tag.getWidth, req.tag.getWidth))
    channel.req.valid := flat.req.valid
    channel.req.bits  := flat.req.bits.asTypeOf(req)
    flat.req.ready    := channel.req.ready
    flat.resp.valid   := channel.resp.valid
    flat.resp.bits    := resp.asUInt
    flat
  }
}

/** A packed request, its response, and a mask of the response's valid bits. */
final case class Exchange(req: BigInt, resp: BigInt, mask: BigInt = -1)

/** Sends requests to a channel in random cycles, and compares the responses, in order, with the expected ones.
  *
  * @param offered  probability that a request is offered in a cycle; otherwise the port holds random bits
  */
final class ChannelTester(
    name:      String,
    channel:   FlatChannel,
    tagBits:   Int,
    exchanges: Seq[Exchange],
    offered:   Double,
    random:    Random
) {
  private val toSend  = mutable.Queue.from(exchanges)
  private val pending = mutable.Queue.empty[(Exchange, Int)] // with the cycle of the request
  private var offer   = Option.empty[Exchange]               // with its tag

  /** Requests accepted, and responses. */
  var requests  = 0
  var responses = 0

  /** The least number of cycles from an accepted request to its response. */
  var latency = Int.MaxValue

  private var cycle = 0

  def isDone: Boolean = responses == exchanges.size

  def before(): Unit = {
    if (offer.isEmpty && toSend.nonEmpty && random.nextDouble() < offered) offer = Some(tagged(toSend.dequeue()))
    channel.req.valid.poke(offer.nonEmpty)
    channel.req.bits.poke(offer.fold(BigInt(channel.req.bits.getWidth, random))(_.req))
  }

  def after(): Unit = {
    if (channel.resp.valid.peekBoolean()) {
      assert(pending.nonEmpty, s"$name: a response without a request")
      responses += 1
      val found              = channel.resp.bits.peekInt()
      val (expected, sentAt) = pending.dequeue()
      latency = latency.min(cycle - sentAt)
      assert(
        (found & expected.mask) == (expected.resp & expected.mask),
        s"$name: response $responses is ${found.toString(16)}, not ${expected.resp.toString(16)}"
      )
    }
    for (exchange <- offer if channel.req.ready.peekBoolean()) {
      requests += 1
      pending += exchange -> cycle
      offer = None
    }
    cycle += 1
  }

  private def tagged(exchange: Exchange): Exchange = {
    val tag = BigInt(tagBits, random)
    Exchange(
      exchange.req << tagBits | tag,
      exchange.resp << tagBits | tag,
      exchange.mask << tagBits | ((BigInt(1) << tagBits) - 1)
    )
  }
}

object ChannelTester {

  /** Steps until all responses have arrived, and some more cycles, in which no other response may arrive.
    *
    * @param watch  called in each cycle
    * @return cycles up to the last response
    */
  def run(clock: Clock, testers: Seq[ChannelTester], watch: () => Unit = () => ()): Int = {
    var cycles, quiet = 0
    def step(): Unit  = {
      val before = testers.map(_.responses).sum
      testers.foreach(_.before())
      testers.foreach(_.after())
      watch()
      clock.step()
      cycles += 1
      quiet = if (testers.map(_.responses).sum == before) quiet + 1 else 0
      assert(quiet < 200, "no more responses")
    }
    clock.setTimeout(0)
    while (!testers.forall(_.isDone)) step()
    val last = cycles
    for (_ <- 0 until 20) step()
    last
  }
}

/** Delays requests to an environment's maps, and their responses, at random. Without a valid response the port has
  * noise, as it has the responses of other requesters in an array.
  */
object SlowMaps {

  /** @param requester has at most 16 requests in flight in each channel */
  def connect(requester: AttributePort, maps: AttributePort, isSlow: Bool): Unit = {
    // Each channel stops for single cycles, and for 16 together, so that it falls behind the others
    val noise                 = LFSR(16)
    val (_, ends)             = Counter(true.B, 16)
    val stops                 = RegEnable(noise, 0.U, ends)
    def holds(bit: Int): Bool = isSlow && (noise(bit) || stops(bit))
    join(requester.cells, maps.cells, holds(0), noise)
    join(requester.planes, maps.planes, holds(5), noise)
    join(requester.albedo, maps.albedo, holds(9), noise)
    join(requester.normals, maps.normals, holds(3), noise)
  }

  private def join[Q <: Data, R <: Data](
      requester: AttributeChannel[Q, R],
      map:       AttributeChannel[Q, R],
      holds:     Bool,
      noise:     UInt
  ): Unit = {
    map.req.valid       := requester.req.valid && !holds
    map.req.bits        := requester.req.bits
    requester.req.ready := map.req.ready && !holds

    val responses = Wire(Decoupled(chiselTypeOf(map.resp.bits)))
    responses.valid := map.resp.valid
    responses.bits  := map.resp.bits
    val waiting = Queue(responses, 16, flow = true)
    waiting.ready        := !holds
    requester.resp.valid := waiting.fire
    val bits  = waiting.bits.asUInt
    val other = Fill(bits.getWidth / noise.getWidth + 1, noise)(bits.getWidth - 1, 0)
    requester.resp.bits := Mux(waiting.fire, bits, other).asTypeOf(requester.resp.bits)
  }
}
