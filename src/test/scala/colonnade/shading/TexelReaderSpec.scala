package colonnade.shading

import chiseltest._
import colonnade.RandomPorts.{peek, randomise}
import colonnade.TestConfigs
import colonnade.TestParts._
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

class TexelReaderSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "TexelReader"

  it should "give the hits of each kind their texels in order, for any latency of the memory" in {
    val queueDepth = 5
    test(new TexelReader(TestConfigs.withTextures, queueDepth)) { dut =>
      val io           = dut.io
      val random       = new Random(62)
      val waiting      = mutable.Queue.empty[(Seq[BigInt], Boolean)] // position, and is a bounce
      val underWay     = mutable.Queue.empty[Boolean]
      var (left, idle) = (80, 0)
      def isWilling    = random.nextBoolean()
      while (left + waiting.size + underWay.size > 0) {
        val texel   = io.port.resp
        val answers = underWay.nonEmpty && isWilling
        randomise(texel.bits, random)
        texel.valid.poke(answers)
        val isBounce = answers && underWay.dequeue()
        io.isIllegal.expect(answers && texel.bits.isIllegal.peekBoolean())
        for ((port, isItsKind) <- Seq(io.lit -> !isBounce, io.bounced -> isBounce)) {
          port.valid.expect(answers && isItsKind)
          if (answers) assert(peek(port.bits) == peek(texel.bits.colour).reverse)
        }

        val accepts = isWilling
        io.port.req.ready.poke(accepts)
        idle += 1
        assert(idle < 50, s"no request with ${waiting.size} hits")
        if (waiting.isEmpty) idle = 0
        if (io.port.req.valid.peekBoolean()) {
          idle = 0
          assert(peek(io.port.req.bits) == waiting.head._1)
          if (accepts) underWay += waiting.dequeue()._2
        }

        val comes = left > 0 && waiting.size + underWay.size < queueDepth && isWilling
        randomise(io.hit.bits, random)
        io.hit.valid.poke(comes)
        if (comes) {
          waiting += peek(io.hit.bits.position) -> io.hit.bits.isBounce.peekBoolean()
          left -= 1
        }
        dut.clock.step()
      }
    }
  }
}
