package colonnade.traversal

import chiseltest._
import colonnade.{Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

/** No ray slips between triangles that share an edge or a vertex, at any rounding. */
class WatertightSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "The triangle test"

  for ((config, seed) <- TestConfigs.formats.zipWithIndex)
    it should s"hit fans at their vertex and edges in the model, formats $seed" in {
      val questions = new TriangleQuestions(config, seed + 20)
      val fans      = Seq.fill(2000)(questions.fan)
      val hits      = questions.expected(fans.flatMap { case (ray, triangles) => triangles.map((ray, _)) }).iterator
      for ((ray, triangles) <- fans)
        withClue(s"$ray against $triangles: ")(hits.take(triangles.size).toSeq.exists(_.isHit) shouldBe true)
    }

  it should "hit them in hardware as in the model" in {
    val config = TestConfigs.withPrecision(16, 16, 16)
    test(new TriangleUnit(config)).withAnnotations(Simulation.verilator) { unit =>
      val questions = new TriangleQuestions(config, seed = 30)
      val harness   = new TriangleHarness(config, questions)
      val fans      = Seq.fill(60)(questions.fan)
      val records   = fans.flatMap { case (ray, triangles) => triangles.grouped(2).map(harness.candidate(ray, _)) }
      harness.run(unit, records, bubbles = 0, stalls = 0)._2 should be >= fans.size
    }
  }
}
