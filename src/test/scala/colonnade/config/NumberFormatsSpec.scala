package colonnade.config

import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

class NumberFormatsSpec extends AnyFlatSpec with Matchers {
  behavior of "NumberFormats"

  private def numbers(mac: Int, sqrt: Int, div: Int, vertexBits: Int, triangleBits: String = "null"): NumberFormats =
    ConfigIO.load(
      s"${mac}b${sqrt}s${div}d",
      Seq(s"geometry.vertexBits=$vertexBits", s"geometry.triangleBits=$triangleBits")
    ).numbers

  it should "give the reference widths for 32b32s64d" in {
    val reference = numbers(32, 32, 64, 16)
    reference.gridBits shouldBe 32
    reference.gridFraction shouldBe 13
    reference.sceneBits shouldBe 40
    reference.directionBits shouldBe 45
    reference.boxPadLog shouldBe 1
  }

  it should "stay in range for every precision and vertex width" in {
    for {
      mac        <- 16 to 64 by 3
      sqrt       <- Seq(16, 17, 64)
      div        <- 16 to 64 by 6
      vertexBits <- Seq(10, 16, 24)
      triangles  <- Seq("null", "16", "64")
    } withClue(s"${mac}b${sqrt}s${div}d, $vertexBits vertex bits, triangle tests of $triangles: ") {
      val n = numbers(mac, sqrt, div, vertexBits, triangles)
      n.gridBits - n.gridFraction shouldBe vertexBits + 3
      n.directionBits should be > n.sceneBits
      Seq(n.shearDigits, n.reciprocalDigits, n.distanceDigits, n.weightBits, n.cosineFraction).min should be >= 8
      n.radicandBits % 2 shouldBe 0
      n.entries.map(_._1).distinct.size shouldBe n.entries.size
    }
  }

  it should "pad boxes more with fewer digits" in {
    val pads = (64 to 16 by -4).map(bits => numbers(bits, 32, bits, 16).boxPadLog)
    pads shouldBe pads.sorted
  }
}
