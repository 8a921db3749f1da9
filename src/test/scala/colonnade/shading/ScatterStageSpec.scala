package colonnade.shading

import chiseltest._
import colonnade.TestParts._
import colonnade.config.NumberFormats
import colonnade.{Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** Gathered rays and microfacets have the directions of [[GatherReference]], with the densities that it should have. */
class ScatterStageSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "ScatterStage"

  for (mac <- Seq(16, 32))
    it should s"scatter rays about an axis every three cycles with $mac bits" in {
      val config = TestConfigs.gathering(TestConfigs.withPrecision(mac, mac, 2 * mac))
      test(new ScatterStage(config)).withAnnotations(Simulation.verilator) { dut =>
        val shadeBits = NumberFormats.colourBits.+(6).min(mac)
        val random    = new Random(mac)
        val count     = 400
        val cases     = Seq.tabulate(count) { index =>
          val alpha    = if (random.nextInt(3) > 0) Some(random.nextInt(256)) else None
          val isFacet  = alpha.nonEmpty && random.nextBoolean()
          val (u, v)   = (random.nextInt(256), random.nextInt(256))
          val scale    = (1 << (shadeBits - 9)) * (if (index % 3 == 0) 1 else -1)
          val extremes = GatherReference.sphere(u, v).map(_ * scale) // the point lies along the axis or against it
          val axis     = if (index % 4 == 0) extremes else normal(random, shadeBits)
          ScatterCase(axis, normal(random, 11), normal(random, shadeBits), u, v, alpha, isFacet)
        }
        dut.clock.setTimeout(0)
        def during[T](cycle: Int, first: Int)(use: (Int, Int) => T): Unit = {
          val (operation, axis) = ((cycle - first) / 3, (cycle - first) % 3)
          if (cycle >= first && operation < count) use(operation, axis)
        }
        for (cycle <- 0 until 3 * count + ScatterStage.facet0 + 3) {
          dut.io.phase.poke(cycle % 3)
          during(cycle, 0) { (operation, axis) =>
            val ScatterCase(_, _, _, u, v, _, _) = cases(operation)
            // The point is there in one cycle only
            dut.io.point.u.poke(if (axis == 0) u else random.nextInt(256))
            dut.io.point.v.poke(if (axis == 0) v else random.nextInt(256))
          }
          during(cycle, 1) { (operation, axis) =>
            dut.io.isBounce.poke(cases(operation).isFacet)
            dut.io.faceForwardNormal.poke(cases(operation).geometric(axis))
            dut.io.dir.poke(cases(operation).dir(axis))
          }
          during(cycle, LobeAxisStage.axis0)((operation, axis) => dut.io.axis.poke(cases(operation).axis(axis)))
          during(cycle, new AngleCycles(config).square) { (operation, axis) =>
            val square = cases(operation).axis.map(component => BigInt(component) * component).sum
            dut.io.squaredAxis.poke(if (axis == 0) square else BigInt(0))
          }
          during(cycle, ScatterStage.rough)((operation, _) => dut.io.alpha.poke(cases(operation).alpha.getOrElse(0)))
          during(cycle, ScatterStage.rough + 3) { (operation, axis) =>
            dut.io.isFacet.poke(cases(operation).isFacet)
            dut.io.isRough.poke(cases(operation).alpha.nonEmpty ^ axis > 0)
          }
          during(cycle, ScatterStage.dir0) { (operation, axis) =>
            val ScatterCase(normal, geometric, _, u, v, alpha, isFacet) = cases(operation)
            val expected = GatherReference.direction(normal, geometric, shadeBits, u, v, alpha)(axis)
            if (!isFacet) dut.io.scatter.expect(expected, s"case $operation")
          }
          during(cycle, ScatterStage.facet0) { (operation, axis) =>
            val ScatterCase(normal, _, dir, u, v, alpha, isFacet) = cases(operation)
            if (isFacet && axis == 0) {
              val expected = GatherReference.microfacet(normal, dir, shadeBits, u, v, alpha.get)
              for ((component, value) <- dut.io.microfacet.zip(expected))
                component.expect(value >> (shadeBits - ScatterStage.facetBits), s"case $operation")
            }
          }
          dut.clock.step()
        }
      }
    }

  private val all  = for (u <- 0 until 256; v <- 0 until 256) yield (u, v)
  private val axes = {
    val random = new Random(3)
    Seq(Seq(1, 0, 0), Seq(0, -1, 0), Seq(0, 0, 1)).map(_.map(_ * ((1 << 18) - 1))) ++ Seq.fill(5)(normal(random, 18))
  }

  private def cosine(a: Seq[Int], b: Seq[Int]): Double = {
    def dot(a: Seq[Int], b: Seq[Int]) = a.zip(b).map { case (x, y) => x.toDouble * y }.sum
    dot(a, b) / math.sqrt(dot(a, a)) / math.sqrt(dot(b, b))
  }

  "Directions of a diffuse surface" should "have the cosine as their density, and none be zero" in {
    for (normal <- axes) {
      val cosines = all.map { case (u, v) =>
        val direction = GatherReference.direction(normal, normal.map(_ >> 7), 18, u, v, None)
        assert(direction.exists(_ != 0))
        cosine(direction, normal)
      }
      assert(cosines.count(_ < 0) <= cosines.size / 200, "below the surface")
      assert(math.abs(cosines.sum / cosines.size - 2.0 / 3) <= 0.001, s"mean cosine at $normal")
      assert(math.abs(cosines.map(x => x * x).sum / cosines.size - 0.5) <= 0.001, s"mean squared cosine at $normal")
    }
  }

  "Directions of rough metal" should "be spread like reflections at microfacets (GGX)" in {
    for (axis <- axes; alpha <- Seq(17, 52, 128)) {
      // A surface below that no ray reaches
      val halves = all.map { case (u, v) =>
        val direction = GatherReference.direction(axis, Seq(0, 0, 0), 18, u, v, Some(alpha))
        math.sqrt((1 + cosine(direction, axis)) / 2)
      }.sorted
      for (share <- Seq(26, 64, 128, 192, 230).map(_ / 256.0)) {
        val index = math.rint((1 - share) * halves.size).toInt
        // The points have 256 to 512 heights about an axis: the mean of some
        val found    = halves.slice(index - 256, index + 256).sum / 512
        val expected = 1 / math.sqrt(1 + math.pow(alpha / 256.0, 2) * share / (1 - share))
        assert(
          math.abs(found - expected) <= (if (share > 0.75) 0.0012 else 0.001),
          s"quantile $share of $alpha about $axis"
        )
      }
    }
  }

  "Microfacets" should "have the angles of Trowbridge and Reitz (GGX), and face the ray" in {
    for (normal <- axes; alpha <- Seq(10, 64, 255)) {
      val against = normal.map(-_)
      val cosines = all.map { case (u, v) =>
        cosine(GatherReference.microfacet(normal, against, 18, u, v, alpha), normal)
      }.sorted
      for (share <- Seq(26, 64, 128, 192, 230).map(_ / 256.0)) {
        val index    = math.rint((1 - share) * cosines.size).toInt
        val found    = cosines.slice(index - 256, index + 256).sum / 512
        val expected = 1 / math.sqrt(1 + math.pow(alpha / 1024.0, 2) * share / (1 - share))
        assert(
          math.abs(found - expected) <= (if (share > 0.75) 0.003 else 0.001),
          s"quantile $share of $alpha about $normal"
        )
      }
    }
    val grazing = Seq(131000, 0, -9000) // one facet in ten would face away
    val away    = all.count { case (u, v) =>
      cosine(GatherReference.microfacet(axes(2), grazing, 18, u, v, 64), grazing) >= 0
    }
    assert(away <= all.size / 200, s"$away facets face away")
  }

  /** A normal whose largest component has `bits` bits. */
  private def normal(random: Random, bits: Int): Seq[Int] = {
    val drawn = Seq.fill(3)(random.nextGaussian())
    val scale = (1 + random.nextDouble()) * (1 << (bits - 1)) / drawn.map(math.abs).max
    drawn.map(x => (x * scale).toInt)
  }
}

/** A surface, its ray and its sample point; `alpha` is the width of rough metal or of microfacets. */
final private case class ScatterCase(
    axis:      Seq[Int],
    geometric: Seq[Int],
    dir:       Seq[Int],
    u:         Int,
    v:         Int,
    alpha:     Option[Int],
    isFacet:   Boolean
)
