package colonnade.shading

import chiseltest._
import colonnade.{Always, Model, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** Geometric normals are those of the model. */
class GeometricNormalStageSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "GeometricNormalStage"

  for (vertexBits <- Seq(10, 16, 19))
    it should s"find a normal every three cycles with $vertexBits bits a coordinate" taggedAs
      Always.unless(vertexBits != 16) in
      test(new GeometricNormalStage(TestConfigs.tiny.geometry.copy(vertexBits = vertexBits)))
        .withAnnotations(Simulation.verilator) { dut =>
          val random  = new Random(vertexBits)
          val cases   = Seq.fill(500)(triangle(random, vertexBits)) ++ extremes(vertexBits)
          val normals = Model.answers(TestConfigs.tiny, cases.map(_.flatten), "geometricnormal")
          dut.clock.setTimeout(0)
          for (cycle <- 0 until 3 * cases.size + GeometricNormalStage.normal0) {
            dut.io.phase.poke(cycle % 3)
            for (vertices <- cases.lift(cycle / 3); (port, vertex) <- dut.io.vertices.zip(vertices))
              for ((component, value) <- port.axes.zip(vertex)) component.poke(value)
            val of = cycle - GeometricNormalStage.normal0
            if (of >= 0) dut.io.normal.expect(normals(of / 3)(of % 3), s"${cases(of / 3)}")
            dut.clock.step()
          }
        }

  /** A triangle of any size, some without area. */
  private def triangle(random: Random, bits: Int): Seq[Seq[BigInt]] = {
    val size         = 1 + random.nextInt(bits)
    val base         = Seq.fill(3)(BigInt(bits, random) >> size << size)
    val Seq(a, b, c) = Seq.fill(3)(base.map(_ + BigInt(size, random)))
    random.nextInt(10) match {
      case 0 => Seq(a, b, b)
      case 1 => Seq(a, a, c)
      case 2 => Seq(a, b.init :+ a.last, c.init :+ a.last)
      case _ => Seq(a, b, c)
    }
  }

  /** The largest cross products, and those of components 0, 1 and -1. */
  private def extremes(bits: Int): Seq[Seq[Seq[BigInt]]] = {
    val most = (BigInt(1) << bits) - 1
    for {
      high <- Seq(most, BigInt(1))
      vertices = Seq.tabulate(8)(i => Seq.tabulate(3)(axis => if ((i >> axis & 1) != 0) high else BigInt(0)))
      corners <- vertices.combinations(3)
    } yield corners
  }
}
