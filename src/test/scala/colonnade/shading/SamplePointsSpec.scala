package colonnade.shading

import chiseltest._
import colonnade.TestConfigs
import colonnade.TestParts._
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** A sample point is a function of the pixel, the number of the ray, and registers. */
class SamplePointsSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "SamplePoints"

  private val tiny   = TestConfigs.gathering(TestConfigs.tiny)
  private val config = tiny.copy(units = tiny.units.copy(pathContexts = 5))

  it should "give each context the point of its pixel and of its next ray, and say where rough metal has a lobe" in
    test(new SamplePoints(config)) { dut =>
      val random = new Random(1)
      val frame  = Seq.fill(4)((random.nextInt(256), random.nextInt(256)))
      for ((port, (u, v)) <- dut.io.gather.points.zip(frame)) {
        port.u.poke(u)
        port.v.poke(v)
      }
      val pixels = Array.fill(5)((0, 0))
      for (round <- 0 until 300) {
        val context = if (round < 5) round else random.nextInt(5)
        pixels(context) = (random.nextInt(640), random.nextInt(480))
        dut.io.pixel.valid.poke(true)
        dut.io.pixel.bits.context.poke(context)
        dut.io.pixel.bits.pixel.x.poke(pixels(context)._1)
        dut.io.pixel.bits.pixel.y.poke(pixels(context)._2)
        dut.clock.step()
        dut.io.pixel.valid.poke(false)
        val (reader, count) = (random.nextInt(5.min(round + 1)), random.nextInt(4))
        dut.io.port.read.valid.poke(true)
        dut.io.port.read.bits.poke(reader)
        dut.clock.step()
        dut.io.port.read.valid.poke(false)
        dut.io.count.poke(count)
        val bounces = random.nextInt(5)
        dut.io.gather.bounces.poke(bounces)
        val (isBounce, backSide) = (random.nextBoolean(), random.nextBoolean())
        dut.io.port.isBounce.poke(isBounce)
        dut.io.port.backSide.poke(backSide)
        val ray    = if (isBounce) count ^ (if (backSide) 2 else 3) else count
        val (u, v) = GatherReference.pixel(pixels(reader)._1, pixels(reader)._2)
        dut.io.port.point.u.expect(u ^ frame(ray)._1)
        dut.io.port.point.v.expect(v ^ frame(ray)._2)
        dut.io.port.isOn.expect(bounces > 0)
        dut.io.port.hasLobe.expect(bounces == 0 || count < bounces)
      }
    }

  "Points of pixels" should "be spread evenly over squares of 4 and 8 pixels" in
    (for (edge <- Seq(4, 8); left <- 0 until 64 by edge; top <- 0 until 64 by edge) {
      val points = for (x <- left until left + edge; y <- top until top + edge) yield GatherReference.pixel(x, y)
      assert(points.map { case (u, v) => (u * edge / 256, v * edge / 256) }.distinct.size == edge * edge)
    })
}
