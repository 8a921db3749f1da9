package colonnade.shading

import chiseltest._
import colonnade.{Simulation, TestConfigs}
import colonnade.TestParts._
import colonnade.numbers.FixedPorts._
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** A path meets the texel in the direction of its last ray that is no shadow ray. */
class LightCubeSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "LightCube"

  private val tiny   = TestConfigs.gathering(TestConfigs.tiny)
  private val config = tiny.copy(units = tiny.units.copy(pathContexts = 4))

  it should "read the texel of a direction" in
    test(new LightCube(config)).withAnnotations(Simulation.verilator) { dut =>
      val random                                                       = new Random(4)
      val bits                                                         = config.numbers.directionBits
      val last                                                         = Array.fill(4)(0)
      def ray(context: Int, dir: Seq[BigInt], isShadow: Boolean): Unit = {
        dut.io.ray.valid.poke(true)
        dut.io.ray.bits.context.poke(context)
        dut.io.ray.bits.isShadow.poke(isShadow)
        dut.io.ray.bits.dir.axes.zip(dir).foreach { case (axis, value) => axis.poke(value) }
        dut.clock.step()
        dut.io.ray.valid.poke(false)
        if (!isShadow) last(context) = GatherReference.texel(dir)
      }
      def direction(): Seq[BigInt] = random.nextInt(4) match {
        case 0 => Seq.fill(3)(BigInt(random.nextInt(5) - 2) << random.nextInt(bits - 3))
        case 1 => Seq.fill(3)(BigInt(random.nextInt(9) - 4))
        case _ => Seq.fill(3)(BigInt(bits - 1, random) * (random.nextInt(2) * 2 - 1))
      }
      for (context <- 0 until 4) ray(context, direction(), isShadow = false)
      for (_ <- 0 until 2000) {
        ray(random.nextInt(4), direction(), random.nextInt(4) == 0)
        dut.clock.step(2)
        val context = random.nextInt(4)
        dut.io.port.read.valid.poke(true)
        dut.io.port.read.bits.poke(context)
        dut.clock.step()
        dut.io.port.read.valid.poke(false)
        dut.io.memory.read.valid.expect(true)
        dut.io.memory.read.bits.expect(last(context))
        dut.clock.step()
        // The word is there in one cycle, the light stays
        val word = Seq.fill(3)(random.nextInt(65536))
        dut.io.memory.word.channels.zip(word).foreach { case (port, value) => port.pokeRaw(value) }
        for (_ <- 0 to random.nextInt(3)) {
          dut.io.port.light.channels.zip(word).foreach { case (port, value) => assert(port.peekRaw() == value) }
          dut.clock.step()
          dut.io.memory.word.channels.foreach(_.pokeRaw(random.nextInt(65536)))
        }
      }
    }
}
