package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, Valid}
import chiseltest._
import colonnade.{Simulation, TestConfigs}
import colonnade.config.ColonnadeConfig
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

class AttributeArbiterSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "AttributeArbiter"

  private val count = 4

  for (lastFirst <- Seq(false, true))
    it should s"grant in turn${if (lastFirst) ", the last requester before the others" else ""}" in
      test(new AttributeArbiter(UInt(8.W), UInt(8.W), count, tagBits = 0, lastFirst)) { dut =>
        val random  = new Random(1)
        val peers   = if (lastFirst) count - 1 else count
        val sent    = Array.fill(count)(0)
        var offered = Array.fill(count)(false)
        val passed  = Array.fill(count)(0) // grants of peers while a requester waits
        var joined  = Vector.empty[(Int, Int)]
        var granted = Vector.empty[(Int, Int)]
        for (_ <- 0 until 2000) {
          offered = offered.map(_ || random.nextInt(3) == 0)
          for ((port, i) <- dut.io.requesters.zipWithIndex) {
            port.req.valid.poke(offered(i))
            port.req.bits.content.poke(sent(i) % 256)
          }
          dut.io.joined.req.ready.poke(random.nextInt(3) > 0)
          val fires = (0 until count).filter(i => offered(i) && dut.io.requesters(i).req.ready.peekBoolean())
          assert(fires.size <= 1)
          for (winner <- fires) {
            if (lastFirst && offered.last) assert(winner == count - 1)
            granted :+= ((winner, sent(winner) % 256))
            sent(winner) += 1
            passed(winner) = 0
            if (winner < peers) for (i <- 0 until peers if i != winner && offered(i)) {
              passed(i) += 1
              assert(passed(i) < peers, s"requester $i waits its turn")
            }
          }
          if (dut.io.joined.req.valid.peekBoolean() && dut.io.joined.req.ready.peekBoolean()) {
            val request = dut.io.joined.req.bits
            joined :+= ((request.tag.peekInt().toInt, request.content.peekInt().toInt))
          }
          dut.clock.step()
          for (winner <- fires) offered(winner) = false
        }
        assert(joined == granted.take(joined.size) && joined.size > 1000)
        assert(sent.forall(_ > 100))

        for ((port, number) <- dut.io.requesters.zipWithIndex) {
          dut.io.joined.resp.valid.poke(true)
          dut.io.joined.resp.bits.tag.poke(number)
          dut.clock.step()
          dut.io.requesters.foreach(each => each.resp.valid.expect(each eq port))
        }
      }
}

/** Channels with one integer each way. */
private class ConcentratorHarness(config: ColonnadeConfig, requesters: Int, tagBits: Int, ofColumn: Boolean)
    extends Module {
  private val unit = Module(new AttributeConcentrator(config, requesters, tagBits, ofColumn)).io

  /** By requester and channel; by channel. */
  val ports  = unit.ports.map(FlatChannel.all)
  val joined = FlatChannel.channels(unit.joined).map { channel =>
    val req  = IO(Decoupled(UInt(channel.req.bits.getWidth.W)))
    val resp = IO(Flipped(Valid(UInt(channel.resp.bits.getWidth.W))))
    req.valid          := channel.req.valid
    req.bits           := channel.req.bits.asUInt
    channel.req.ready  := req.ready
    channel.resp.valid := resp.valid
    channel.resp.bits  := resp.bits.asTypeOf(channel.resp.bits)
    (req, resp)
  }
}

class AttributeConcentratorSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "AttributeConcentrator"

  private val config              = TestConfigs.withEnvironment(TestConfigs.environment)
  private val requesters          = 4
  private val (tagBits, allBits)  = (3, AttributeArbiter.tagBits(requesters, 3))
  private val (count, lastChance) = (12, 0.25)

  /** What a map answers: any function of channel and request. */
  private def answer(channel: Int, request: BigInt, bits: Int): BigInt =
    (request * 0x9e3779b1L + channel * 77777) & ((BigInt(1) << bits) - 1)

  for (ofColumn <- Seq(true, false))
    it should s"give each requester its own answers, ${if (ofColumn) "directly seen pixels first" else "by round-robin"}" in
      test(new ConcentratorHarness(config, requesters, tagBits, ofColumn)).withAnnotations(Simulation.verilator) {
        dut =>
          val random  = new Random(2)
          val testers = for ((channels, requester) <- dut.ports.zipWithIndex) yield {
            val offered = if (requester == requesters - 1) lastChance else 0.7
            for ((channel, number) <- channels.zipWithIndex) yield {
              val reqBits   = channel.req.bits.getWidth - tagBits
              val exchanges = Seq.fill(count) {
                val request = BigInt(reqBits, random)
                Exchange(request, answer(number, request, channel.resp.bits.getWidth - tagBits))
              }
              new ChannelTester(s"channel $number of $requester", channel, tagBits, exchanges, offered, random)
            }
          }
          val inFlight = dut.joined.map(_ => mutable.Queue.empty[(Int, BigInt)]) // due, request with its tag
          val waits    = Array.fill(4, requesters)(0)                            // grants of others while one waits
          var cycle    = 0
          ChannelTester.run(
            dut.clock,
            testers.flatten,
            () => {
              for (((req, resp), number) <- dut.joined.zipWithIndex) {
                // A map that answers at any time, in order
                val isReady = random.nextInt(3) > 0
                val due     = inFlight(number).headOption.filter(_._1 <= cycle)
                req.ready.poke(isReady)
                resp.valid.poke(due.nonEmpty)
                for ((_, bits) <- due) {
                  val (request, tag) = (bits >> allBits, bits & ((BigInt(1) << allBits) - 1))
                  resp.bits.poke(answer(number, request, resp.bits.getWidth - allBits) << allBits | tag)
                  inFlight(number).dequeue()
                }
                if (isReady && req.valid.peekBoolean())
                  inFlight(number).enqueue((cycle + 1 + random.nextInt(9), req.bits.peekInt()))

                // Who is granted
                val reqs    = dut.ports.map(_(number).req)
                val asking  = reqs.indices.filter(reqs(_).valid.peekBoolean())
                val granted = asking.filter(reqs(_).ready.peekBoolean())
                val isLast  = ofColumn && asking.contains(requesters - 1)
                assert(granted.size <= 1 && (!isLast || granted.forall(_ == requesters - 1)), s"of $asking in $number")
                for (winner <- granted) {
                  waits(number)(winner) = 0
                  if (!isLast) for (other <- asking if other != winner) {
                    waits(number)(other) += 1
                    assert(waits(number)(other) < requesters, s"requester $other waits too long in $number")
                  }
                }
              }
              cycle += 1
            }
          )
      }

  it should "let a channel go on while another one waits" in
    test(new ConcentratorHarness(config, requesters, tagBits, ofColumn = true)) { dut =>
      for (blocked <- dut.joined.indices) {
        val passed = Array.fill(4)(0)
        for (((req, _), number) <- dut.joined.zipWithIndex) req.ready.poke(number != blocked)
        dut.ports.foreach(_.foreach(_.req.valid.poke(true)))
        for (_ <- 0 until 12) {
          for (((req, _), number) <- dut.joined.zipWithIndex if number != blocked && req.valid.peekBoolean())
            passed(number) += 1
          dut.clock.step()
        }
        assert(passed.zipWithIndex.forall { case (passed, number) => number == blocked || passed >= 11 })
      }
    }
}
