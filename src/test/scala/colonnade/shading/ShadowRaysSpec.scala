package colonnade.shading

import chiseltest._
import colonnade.TestConfigs
import colonnade.numbers.FixedPorts._
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** Each ray goes from its context's surface to its light. */
class ShadowRaysSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "ShadowRays"

  for (config <- Seq(TestConfigs.tiny, TestConfigs.withPrecision(16, 16, 32), TestConfigs.withPrecision(64, 64, 64)))
    it should s"send rays from remembered surfaces at ${config.precision}" in test(new ShadowRays(config)) { dut =>
      val random                    = new Random(7)
      val numbers                   = config.numbers
      def signed(bits: Int): BigInt = BigInt(bits, random) - (BigInt(1) << (bits - 1))
      val shift                     = random.nextInt(5) + 1
      val bits                      = numbers.macBits.min(numbers.sceneBits - shift)
      val lights                    = Seq.fill(config.frame.lights)(Seq.fill(3)(signed(bits)))
      dut.io.unitShift.poke(shift)
      for ((port, light) <- dut.io.lights.zip(lights); (axis, value) <- port.position.axes.zip(light)) axis.poke(value)

      for (_ <- 0 until 10) {
        val surfaces = Seq.fill(config.array.contexts)(Seq.fill(3)(signed(numbers.sceneBits)))
        for ((surface, context) <- surfaces.zipWithIndex) {
          dut.io.surface.valid.poke(true)
          dut.io.surface.bits.context.poke(context)
          dut.io.surface.bits.origin.axes.zip(surface).foreach { case (axis, value) => axis.pokeRaw(value) }
          dut.clock.step()
        }
        dut.io.surface.valid.poke(false)
        for ((context, light) <- random.shuffle(for (c <- surfaces.indices; l <- lights.indices) yield (c, l))) {
          dut.io.question.valid.poke(true)
          dut.io.question.bits.context.poke(context)
          dut.io.question.bits.light.poke(light)
          dut.io.question.ready.expect(true)
          dut.clock.step()
          dut.io.question.valid.poke(false)
          dut.clock.step(4)
          dut.io.ray.valid.expect(true)
          if (random.nextBoolean()) dut.clock.step(2)
          dut.io.ray.bits.context.expect(context)
          dut.io.ray.bits.isShadow.expect(true)
          for ((axis, i) <- dut.io.ray.bits.origin.axes.zipWithIndex) assert(axis.peekRaw() == surfaces(context)(i))
          for ((axis, i) <- dut.io.ray.bits.dir.axes.zipWithIndex)
            axis.expect((lights(light)(i) << shift) - surfaces(context)(i))
          dut.io.ray.ready.poke(true)
          dut.clock.step()
          dut.io.ray.ready.poke(false)
        }
      }
    }
}
