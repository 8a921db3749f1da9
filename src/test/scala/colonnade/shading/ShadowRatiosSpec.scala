package colonnade.shading

import chiseltest._
import colonnade.RandomPorts.randomise
import colonnade.TestConfigs
import colonnade.TestParts._
import colonnade.numbers.FixedPorts._
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class ShadowRatiosSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "ShadowRatios"

  private val (bits, one) = (18, 4096)

  /** Less than 2; 1 for 0 / 0. */
  private def ratio(part: Int, whole: Int): Int =
    if (part == whole) one else if (part < 2L * whole) (part.toLong * one / whole).toInt else 2 * one - 1

  /** Light that arrives, and that without the object. What exceeds it may do so by any number of digits. */
  private def light(random: Random, mayExceed: Boolean): (Int, Int) = {
    val whole = random.nextInt(1 << random.nextInt(bits + 1))
    random.nextInt(4) match {
      case 0              => (whole, whole)
      case 1 if mayExceed => (random.nextInt(1 << random.nextInt(bits + 1)), whole)
      case 2 if mayExceed => ((1 << bits) - 1, whole)
      case _              => (random.nextInt(whole + 1), whole)
    }
  }

  private val mapped = TestConfigs.withEnvironment(TestConfigs.environment)
  for (
    (config, name) <- Seq(mapped -> "that takes shadows alone", TestConfigs.gathering(mapped) -> "that gathers light")
  )
    it should s"divide the light of a point by that without the object, in an environment $name" in
      test(new ShadowRatios(config, bits)) { dut =>
        val random = new Random(5)
        for (_ <- 0 until 300) {
          while (dut.io.busy.peekBoolean()) dut.clock.step()
          dut.io.claim.poke(true)
          dut.clock.step()
          dut.io.claim.poke(false)
          dut.clock.step(2 + random.nextInt(3))
          val channels = Seq.fill(3)(light(random, config.frame.gather))
          for (((part, whole), channel) <- channels.zipWithIndex) {
            dut.io.load.valid.poke(true)
            dut.io.load.bits.channel.poke(channel)
            dut.io.load.bits.part.poke(part)
            dut.io.whole.poke(whole)
            dut.clock.step()
            dut.io.load.valid.poke(false)
          }
          val comes  = random.nextInt(12)
          var colour = Seq.empty[Int]
          for (cycle <- 0 until 12) {
            dut.io.colour.valid.poke(cycle == comes)
            randomise(dut.io.colour.bits, random)
            if (cycle == comes) colour = dut.io.colour.bits.colour.channels.map(_.peekInt().toInt)
            dut.io.result.valid.expect(false)
            dut.clock.step()
          }
          dut.io.colour.valid.poke(false)
          dut.io.result.valid.expect(true)
          val result = dut.io.result.bits
          assert(result.colour.channels.map(_.peekInt().toInt) == colour)
          val found = result.ratio.get.channels.map(_.peekRaw().toInt)
          assert(found == channels.map { case (part, whole) => ratio(part, whole) }, s"for $channels")
          dut.io.result.ready.poke(true)
          dut.clock.step()
          dut.io.result.ready.poke(false)
        }
      }
}
