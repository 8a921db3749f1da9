package colonnade.shading

import chisel3.SInt
import chiseltest._
import colonnade.{Simulation, TestConfigs}
import colonnade.TestParts._
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** A path meets the texel in the direction of its last ray, with the light there if it sees lights. */
class LightCubeSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "LightCube"

  private val tiny   = TestConfigs.gathering(TestConfigs.tiny)
  private val config = tiny.copy(units = tiny.units.copy(pathContexts = 4))

  it should "read the texel of a direction" in
    test(new LightCube(config)).withAnnotations(Simulation.verilator) { dut =>
      val random   = new Random(4)
      val bits     = new BounceFormats(config.numbers).bounceBits
      val last     = Array.fill(4)(0)
      var parallax = 0
      // In the object's cube, about it, and far away
      def position(): Seq[BigInt] = {
        val bits = config.numbers.gridBits - 3 + Seq(0, 2, 10)(random.nextInt(3))
        Seq.fill(3)(BigInt(bits, random) * (if (random.nextBoolean()) 1 else -1))
      }
      def ray(context: Int, dir: Seq[BigInt]): Unit = {
        val origin = position()
        dut.io.ray.valid.poke(true)
        dut.io.ray.bits.context.poke(context)
        dut.io.ray.bits.origin.axes.zip(origin).foreach { case (axis, value) =>
          axis.raw.asInstanceOf[SInt].poke(value)
        }
        dut.io.ray.bits.dir.axes.zip(dir).foreach { case (axis, value) => axis.poke(value) }
        dut.clock.step()
        dut.io.ray.valid.poke(false)
        last(context) = GatherReference.texel(origin, dir, parallax, config.numbers.gridBits)
      }
      def direction(): Seq[BigInt] = random.nextInt(4) match {
        case 0 => Seq.fill(3)(BigInt(random.nextInt(5) - 2) << random.nextInt(bits - 3))
        case 1 => Seq.fill(3)(BigInt(random.nextInt(9) - 4))
        case _ => Seq.fill(3)(BigInt(bits - 1, random) * (random.nextInt(2) * 2 - 1))
      }
      for (context <- 0 until 4) ray(context, direction())
      for (number <- 0 until 2000) {
        if (number % 50 == 0) {
          dut.clock.step(2)
          parallax = number / 50 % 4
          dut.io.parallax.poke(parallax)
        }
        ray(random.nextInt(4), direction())
        dut.clock.step()
        val (context, seesLights, isLight) = (random.nextInt(4), random.nextBoolean(), random.nextInt(3) == 0)
        val isReflection                   = random.nextBoolean()
        if (isReflection) dut.clock.step()
        dut.io.port.read.valid.poke(true)
        dut.io.port.read.bits.context.poke(context)
        dut.io.port.read.bits.seesLights.poke(seesLights)
        dut.io.port.read.bits.isReflection.poke(isReflection)
        val texel = last(context)
        // The next ray of the path leaves with the reflection's light
        if (isReflection) ray(context, direction()) else dut.clock.step()
        dut.io.port.read.valid.poke(false)
        dut.io.port.read.bits.seesLights.poke(random.nextBoolean())
        dut.io.port.read.bits.isReflection.poke(random.nextBoolean())
        dut.io.memory.read.valid.expect(false)
        dut.clock.step()
        dut.io.memory.read.valid.expect(true)
        dut.io.memory.read.bits.expect(texel)
        dut.clock.step()
        // The word is there in one cycle, and the texel follows it and stays
        dut.clock.step()
        val word                      = dut.io.memory.word
        val (port, (exponent, light)) = (dut.io.port.texel, (random.nextInt(16), Seq.fill(3)(random.nextInt(128))))
        word.isLight.poke(isLight)
        word.exponent.poke(exponent)
        word.mantissas.channels.zip(light).foreach { case (to, value) => to.poke(value) }
        dut.clock.step()
        for (_ <- 0 to random.nextInt(3)) {
          port.isLight.expect(isLight && seesLights)
          port.exponent.expect(exponent)
          port.mantissas.channels.zip(light).foreach { case (from, value) => from.expect(value) }
          word.isLight.poke(random.nextBoolean())
          word.exponent.poke(random.nextInt(16))
          word.mantissas.channels.foreach(_.poke(random.nextInt(128)))
          dut.clock.step()
        }
      }
    }
}
