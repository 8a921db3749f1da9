package colonnade.traversal

import chiseltest._
import colonnade.TestParts._
import colonnade.{Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

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
