package colonnade.traversal

import chiseltest._
import colonnade.{Always, Simulation, TestConfigs}
import colonnade.config.ColonnadeConfig
import colonnade.TestParts._
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

/** [[TriangleUnit]] against the model, bit for bit. */
class TriangleUnitSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "TriangleUnit"

  private val simulation = Simulation.verilator

  private def name(config: ColonnadeConfig): String =
    s"${config.precision} with ${config.geometry.vertexBits} vertex bits"

  for ((config, seed) <- TestConfigs.formats.zipWithIndex)
    it should s"answer as the model does, under bubbles and stalls, at ${name(config)}" taggedAs Always.ifExtreme(
      config
    ) in {
      test(new TriangleUnit(config)).withAnnotations(simulation) { unit =>
        val harness = new TriangleHarness(config, new TriangleStimulus(config, seed))
        val hits    = Seq((0, 0), (3, 0), (0, 4), (3, 12)).map { case (bubbles, stalls) =>
          harness.run(unit, harness.random(if (stalls == 0) 300 else 60), bubbles, stalls)._2
        }
        hits.sum should be > 180
      }
    }

  it should "follow the model with two division lanes" in {
    val config = TestConfigs.tiny
    test(new TriangleUnit(config, distanceLanes = 2)).withAnnotations(simulation) { unit =>
      val harness = new TriangleHarness(config, new TriangleStimulus(config, seed = 10))
      harness.run(unit, harness.random(300), bubbles = 0, stalls = 0)._2 should be > 60
    }
  }

  it should "take a pair every five cycles, a triangle every four, and a hit every eleven" in {
    val config = TestConfigs.tiny
    test(new TriangleUnit(config)).withAnnotations(simulation) { unit =>
      val stimulus                                        = new TriangleStimulus(config, seed = 11)
      val harness                                         = new TriangleHarness(config, stimulus)
      def cycles(record: => TestCandidate, hits: Boolean) = {
        val (cycles, hit) = harness.run(unit, Seq.fill(50)(record), bubbles = 0, stalls = 0)
        hit shouldBe (if (hits) 100 else 0)
        cycles
      }
      // Triangles without area
      val Seq(a, b) = Seq.fill(2)(stimulus.vertex)
      val flat      = Seq(Seq(a, b, b), Seq(b, a, b)).map(TestTriangle)
      cycles(harness.candidate(stimulus.ray, flat), hits = false) should be <= 50 * 5 + 16
      cycles(harness.candidate(stimulus.ray, flat.take(1)), hits = false) should be <= 50 * 4 + 16

      val middle = BigInt(1) << (config.numbers.vertexBits - 2 + config.numbers.gridFraction)
      val ray    = TestRay(2, Seq.fill(3)(false), Seq(middle, middle, 0), Seq(0, 0))
      val met    = Seq(Seq[BigInt](0, 0, 9), Seq[BigInt](65535, 0, 70), Seq[BigInt](0, 65535, 65535))
      val other  = Seq(met(1), met(0), Seq[BigInt](9, 65535, 9))
      cycles(
        harness.candidate(ray, Seq(TestTriangle(met), TestTriangle(other))),
        hits = true
      ) should be <= 100 * 11 + 60
    }
  }
}

/** No ray passes between triangles that share an edge or a vertex, at any precision. */
class WatertightSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "The triangle test"

  for ((config, seed) <- TestConfigs.formats.zipWithIndex)
    it should s"hit fans at their vertex and edges in the model, formats $seed" in {
      val stimulus = new TriangleStimulus(config, seed + 20)
      val fans     = Seq.fill(2000)(stimulus.fan)
      val hits     = stimulus.expected(fans.flatMap { case (ray, triangles) => triangles.map((ray, _)) }).iterator
      for ((ray, triangles) <- fans)
        withClue(s"$ray against $triangles: ")(hits.take(triangles.size).toSeq.exists(_.isHit) shouldBe true)
    }

  it should "hit them in hardware as in the model" in {
    val config = TestConfigs.withPrecision(16, 16, 16)
    test(new TriangleUnit(config)).withAnnotations(Simulation.verilator) { unit =>
      val stimulus = new TriangleStimulus(config, seed = 30)
      val harness  = new TriangleHarness(config, stimulus)
      val fans     = Seq.fill(60)(stimulus.fan)
      val records  = fans.flatMap { case (ray, triangles) =>
        triangles.map(triangle => harness.candidate(ray, Seq(triangle)))
      }
      harness.run(unit, records, bubbles = 0, stalls = 0)._2 should be >= fans.size
    }
  }
}
