package colonnade.environment

import chisel3._
import chiseltest._
import org.scalatest.flatspec.AnyFlatSpec

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
