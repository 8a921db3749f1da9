package colonnade.shading

import chiseltest._
import colonnade.TestConfigs
import colonnade.TestParts._
import colonnade.config.NumberFormats
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** Gathered rays have the directions of [[GatherReference]], whose density is the cosine. */
class ScatterStageSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "ScatterStage"

  for (mac <- Seq(16, 32))
    it should s"scatter a normal every three cycles with $mac bits" in
      test(new ScatterStage(TestConfigs.gathering(TestConfigs.withPrecision(mac, mac, 2 * mac)))) { dut =>
        val shadeBits = NumberFormats.colourBits.+(6).min(mac)
        val random    = new Random(mac)
        val count     = 400
        val cases     =
          Seq.fill(count)((normal(random, shadeBits), normal(random, 11), random.nextInt(256), random.nextInt(256)))
        dut.clock.setTimeout(0)
        def during[T](cycle: Int, first: Int)(use: (Int, Int) => T): Unit = {
          val (operation, axis) = ((cycle - first) / 3, (cycle - first) % 3)
          if (cycle >= first && operation < count) use(operation, axis)
        }
        for (cycle <- 0 until 3 * count + ScatterStage.dir0 + 3) {
          dut.io.phase.poke(cycle % 3)
          during(cycle, 0) { (operation, axis) =>
            val (_, _, u, v) = cases(operation)
            // The point is there in one cycle only
            dut.io.point.u.poke(if (axis == 0) u else random.nextInt(256))
            dut.io.point.v.poke(if (axis == 0) v else random.nextInt(256))
          }
          during(cycle, 1)((operation, axis) => dut.io.faceForwardNormal.poke(cases(operation)._2(axis)))
          during(cycle, 7)((operation, axis) => dut.io.normal.poke(cases(operation)._1(axis)))
          during(cycle, 16) { (operation, axis) =>
            val square = cases(operation)._1.map(component => BigInt(component) * component).sum
            dut.io.squaredNormal.poke(if (axis == 0) square else BigInt(0))
          }
          during(cycle, ScatterStage.dir0) { (operation, axis) =>
            val (normal, geometric, u, v) = cases(operation)
            dut.io.dir.expect(GatherReference.direction(normal, geometric, shadeBits, u, v)(axis), s"case $operation")
          }
          dut.clock.step()
        }
      }

  "Directions" should "have the cosine as their density, and none be zero" in {
    val random = new Random(3)
    val axes   = Seq(Seq(1, 0, 0), Seq(0, -1, 0), Seq(0, 0, 1)).map(_.map(_ * ((1 << 18) - 1)))
    for (normal <- axes ++ Seq.fill(5)(normal(random, 18))) {
      val length  = math.sqrt(normal.map(x => x.toDouble * x).sum)
      val cosines = for (u <- 0 until 256; v <- 0 until 256) yield {
        val direction = GatherReference.direction(normal, normal.map(_ >> 7), 18, u, v)
        assert(direction.exists(_ != 0))
        direction.zip(normal).map { case (a, b) => a.toDouble * b }.sum / length / math.sqrt(direction.map(x =>
          x.toDouble * x
        ).sum)
      }
      assert(cosines.count(_ < 0) <= cosines.size / 200, "below the surface")
      assert(math.abs(cosines.sum / cosines.size - 2.0 / 3) <= 0.001, s"mean cosine at $normal")
      assert(math.abs(cosines.map(x => x * x).sum / cosines.size - 0.5) <= 0.001, s"mean squared cosine at $normal")
    }
  }

  /** A normal whose largest component has `bits` bits. */
  private def normal(random: Random, bits: Int): Seq[Int] = {
    val drawn = Seq.fill(3)(random.nextGaussian())
    val scale = (1 + random.nextDouble()) * (1 << (bits - 1)) / drawn.map(math.abs).max
    drawn.map(x => (x * scale).toInt)
  }
}
