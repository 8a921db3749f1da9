package colonnade.frame

import chiseltest._
import colonnade.TestConfigs
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class PixelMixerSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "PixelMixer"

  private val config = TestConfigs.withEnvironment(TestConfigs.environment)

  /** Sends `counts` pixels of the object and of the environment, and lets those of the environment leave at random.
    * Returns which of them came, in order: true for the environment.
    */
  private def mix(
      dut:      PixelMixer,
      counts:   (Int, Int),
      most:     Int,
      leaving:  Double,
      offering: Double,
      random:   Random
  ): Seq[Boolean] = {
    val inputs   = Seq(dut.io.objects, dut.io.environment)
    var sent     = Seq(0, 0)
    var order    = Vector.empty[Boolean]
    var inFlight = 0
    var cycles   = 0
    while (order.size < counts._1 + counts._2 || inFlight > 0) {
      val isOffered = sent.zip(Seq(counts._1, counts._2)).map { case (n, of) =>
        n < of && random.nextDouble() < offering
      }
      for (((input, n), offers) <- inputs.zip(sent).zip(isOffered)) {
        input.valid.poke(offers)
        input.bits.x.poke(n % 64)
        input.bits.y.poke(n / 64)
      }
      val meets = random.nextBoolean()
      dut.io.objects.bits.meetsObject.get.poke(meets)
      val leaves = inFlight > 0 && random.nextDouble() < leaving
      dut.io.leaves.poke(leaves)
      val ready = random.nextInt(4) > 0
      dut.io.positions.ready.poke(ready)
      val out = dut.io.positions
      assert(inputs.map(_.ready.peekBoolean()).count(identity) <= 1)
      if (ready && out.valid.peekBoolean()) {
        val isEnvironment = !out.bits.inObjectTile.get.peekBoolean()
        val from          = if (isEnvironment) 1 else 0
        assert(isOffered(from) && inputs(from).ready.peekBoolean())
        assert(out.bits.x.peekInt() + 64 * out.bits.y.peekInt() == sent(from), "in order")
        out.bits.meetsObject.get.expect(!isEnvironment && meets)
        sent = sent.updated(from, sent(from) + 1)
        order :+= isEnvironment
        inFlight += from
      }
      inFlight -= (if (leaves) 1 else 0)
      assert(inFlight <= most)
      dut.clock.step()
      cycles += 1
      assert(cycles < 5000, "ends")
    }
    order
  }

  it should "give every pixel of both tiles once, with at most some of the environment in flight" in {
    for (most <- Seq(1, 5, 40)) test(new PixelMixer(config, most)) { dut =>
      val random = new Random(most)
      for (offering <- Seq(0.4, 1.0)) mix(dut, (150, 200), most, 0.3, offering, random)
    }
  }

  it should "let the environment go first until so many are in flight" in {
    test(new PixelMixer(config, 8)) { dut =>
      val order = mix(dut, (30, 8), 8, 0.05, 1.0, new Random(1))
      assert(order == Seq.fill(8)(true) ++ Seq.fill(30)(false))
    }
  }
}
