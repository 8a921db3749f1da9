package colonnade.traversal

import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.{Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

/** [[TriangleUnit]] against the model, bit for bit. */
class TriangleUnitSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "TriangleUnit"

  private val simulation = Simulation.verilator

  private def name(config: ColonnadeConfig): String =
    s"${config.precision} with ${config.geometry.vertexBits} vertex bits"

  for ((config, seed) <- TestConfigs.formats.zipWithIndex)
    it should s"answer as the model does, under bubbles and stalls, at ${name(config)}" in {
      test(new TriangleUnit(config)).withAnnotations(simulation) { unit =>
        val harness = new TriangleHarness(config, new TriangleStimulus(config, seed))
        val hits    = Seq((0, 0), (3, 0), (0, 4), (3, 12)).map { case (bubbles, stalls) =>
          harness.run(unit, harness.random(if (stalls == 0) 300 else 60), bubbles, stalls)._2
        }
        hits.sum should be > 180
      }
    }

  it should "test records of one triangle with two division lanes" in {
    val config = TestConfigs.tiny.copy(geometry = TestConfigs.tiny.geometry.copy(trianglesPerRecord = 1))
    test(new TriangleUnit(config, distanceLanes = 2)).withAnnotations(simulation) { unit =>
      val harness = new TriangleHarness(config, new TriangleStimulus(config, seed = 10))
      harness.run(unit, harness.random(300), bubbles = 0, stalls = 0)._2 should be > 60
    }
  }

  it should "take a triangle every four cycles, and a hit as fast as the lanes divide" in {
    val config = TestConfigs.tiny
    test(new TriangleUnit(config)).withAnnotations(simulation) { unit =>
      val stimulus = new TriangleStimulus(config, seed = 11)
      val harness  = new TriangleHarness(config, stimulus)
      val point    = stimulus.vertex
      val flat     = TestTriangle(Seq(point, point, stimulus.vertex))
      val misses   = Seq.fill(50)(harness.candidate(stimulus.ray, Seq(flat, flat)))
      harness.run(unit, misses, bubbles = 0, stalls = 0) should matchPattern {
        case (cycles: Int, 0) if cycles <= 4 * 100 + 16 =>
      }

      val middle   = BigInt(1) << (config.numbers.vertexBits - 2 + config.numbers.gridFraction)
      val ray      = TestRay(2, Seq.fill(3)(false), Seq(middle, middle, 0), Seq(0, 0))
      val triangle = TestTriangle(Seq(Seq[BigInt](0, 0, 9), Seq[BigInt](65535, 0, 70), Seq[BigInt](0, 65535, 65535)))
      val hits     = Seq.fill(30)(harness.candidate(ray, Seq(triangle, triangle)))
      harness.run(unit, hits, bubbles = 0, stalls = 0) should matchPattern {
        case (cycles: Int, 60) if cycles <= 60 * 11 + 60 =>
      }
    }
  }
}
