package colonnade.shading

import chiseltest._
import colonnade.{Model, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** Corner normals are those of the model. */
class OctahedralDecoderSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "OctahedralDecoder"

  it should "decode a normal in each cycle" in test(new OctahedralDecoder) { dut =>
    val random = new Random(4)
    val edges  = Seq(-1024, -1023, -512, -1, 0, 1, 511, 512, 1022, 1023)

    def component(): BigInt =
      BigInt(if (random.nextBoolean()) edges(random.nextInt(edges.size)) else random.nextInt(2048) - 1024)
    val codes = (for (u <- edges; v <- edges) yield Seq(BigInt(u), BigInt(v))) ++
      Seq.fill(2000)(Seq(component(), component()))
    val normals = Model.answers(TestConfigs.tiny, codes, "cornernormal")
    for (cycle <- 0 until codes.size + OctahedralDecoder.latency) {
      for (Seq(u, v) <- codes.lift(cycle)) {
        dut.io.code.u.poke(u)
        dut.io.code.v.poke(v)
      }
      for (index <- Option.when(cycle >= OctahedralDecoder.latency)(cycle - OctahedralDecoder.latency))
        for ((component, expected) <- dut.io.normal.axes.zip(normals(index)))
          component.expect(expected, s"${codes(index)}")
      dut.clock.step()
    }
  }
}
