package colonnade.frame

import chiseltest._
import colonnade.TestConfigs
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class PixelMixerSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "PixelMixer"

  private val config = TestConfigs.withEnvironment(TestConfigs.environment)

  /** Sends `counts` pixels of the object and of the environment, and lets them leave at random. While rays have waited for
    * marches, at most `marching` of the object may be in flight. Returns which of them came, in order: true for the
    * environment.
    */
  private def mix(
      dut:      PixelMixer,
      counts:   (Int, Int),
      most:     Int,
      leaving:  Double,
      offering: Double,
      random:   Random,
      marching: Int = 3,
      waiting:  Double = 0
  ): Seq[Boolean] = {
    val inputs   = Seq(dut.io.objects, dut.io.environment)
    var sent     = Seq(0, 0)
    var order    = Vector.empty[Boolean]
    var inFlight = 0
    var objects  = 0
    var sinceOne = PixelMixer.memory + 1 // cycles since a ray waited
    var limited  = 0
    var cycles   = 0
    while (order.size < counts._1 + counts._2 || inFlight + objects > 0) {
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
      val leaves       = inFlight > 0 && random.nextDouble() < leaving
      val objectLeaves = objects > 0 && random.nextDouble() < leaving
      val waits        = random.nextDouble() < waiting
      dut.io.leaving.ofEnvironment.poke(leaves)
      dut.io.leaving.ofObject.poke(objectLeaves)
      dut.io.marchWaits.poke(waits)
      val ready = random.nextInt(4) > 0 && objects < config.units.pathContexts
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
        if (from == 0 && sinceOne <= PixelMixer.memory) {
          assert(objects < marching, "rays wait")
          limited += 1
        }
        objects += 1 - from
      }
      inFlight -= (if (leaves) 1 else 0)
      objects -= (if (objectLeaves) 1 else 0)
      sinceOne = if (waits) 1 else sinceOne + 1
      assert(inFlight <= most)
      dut.clock.step()
      cycles += 1
      assert(cycles < 5000, "ends")
    }
    assert(limited > 0 == waiting > 0)
    order
  }

  it should "give every pixel of both tiles once, with at most some of the environment in flight" in {
    for (most <- Seq(1, 5, 40)) test(new PixelMixer(config, most, 3)) { dut =>
      val random = new Random(most)
      for (offering <- Seq(0.4, 1.0)) mix(dut, (150, 200), most, 0.3, offering, random)
    }
  }

  it should "have few of the object in flight while rays wait for marches, and soon after" in
    test(new PixelMixer(config, 5, 3)) { dut =>
      for (waiting <- Seq(0.01, 0.05, 0.5)) mix(dut, (150, 100), 5, 0.1, 0.8, new Random(4), 3, waiting)
    }

  it should "let the environment go first until so many are in flight" in {
    test(new PixelMixer(config, 8, 3)) { dut =>
      val order = mix(dut, (30, 8), 8, 0.02, 1.0, new Random(1))
      assert(order == Seq.fill(8)(true) ++ Seq.fill(30)(false))
    }
  }
}
