package colonnade.numbers

import chisel3._
import chiseltest._
import colonnade.Properties
import org.scalacheck.{Gen, Prop}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

private class NormaliseHarness(width: Int, mantissaBits: Int) extends Module {
  val x         = IO(Input(UInt(width.W)))
  val result    = IO(Output(new Normalised(mantissaBits, Normalise.exponentBits(width))))
  val bitLength = IO(Output(UInt(Normalise.exponentBits(width).W)))

  result    := Normalise(x, mantissaBits)
  bitLength := Normalise.bitLength(x)
}

class NormaliseSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers with Properties {
  behavior of "Normalise"

  private def check(unit: NormaliseHarness, x: BigInt, mantissaBits: Int): Unit = {
    unit.x.poke(x)
    val exponent = x.bitLength
    val mantissa = if (exponent > mantissaBits) x >> (exponent - mantissaBits) else x << (mantissaBits - exponent)
    withClue(s"x $x: ") {
      unit.result.exponent.peek().litValue shouldBe exponent
      unit.result.mantissa.peek().litValue shouldBe mantissa
      unit.bitLength.peek().litValue shouldBe exponent
    }
  }

  for ((width, mantissaBits) <- Seq((1, 1), (1, 3), (2, 2), (5, 3), (7, 7), (8, 12), (9, 4)))
    it should s"give $mantissaBits bits of every $width-bit number" in {
      test(new NormaliseHarness(width, mantissaBits)) { unit =>
        (0 until 1 << width).foreach(x => check(unit, x, mantissaBits))
      }
    }

  for ((width, mantissaBits) <- Seq((45, 32), (32, 32), (66, 32), (18, 8), (80, 18)))
    it should s"give $mantissaBits bits of $width-bit numbers of every length" in {
      val random = new Random(5)
      test(new NormaliseHarness(width, mantissaBits)) { unit =>
        check(unit, 0, mantissaBits)
        for (length <- 1 to width; _ <- 0 until 4)
          check(unit, (BigInt(1) << (length - 1)) | BigInt(length - 1, random), mantissaBits)
      }
    }

  it should "give a mantissa with its top bit set, and lose less than its last bit, at any width" in holds(cases = 12) {
    val operands = for {
      width        <- Gen.choose(1, 100)
      mantissaBits <- Gen.choose(1, 40)
      values       <- Gen.listOfN(20, RoundingSpec.signed(width + 1).map(_.abs.min((BigInt(1) << width) - 1)))
    } yield (width, mantissaBits, values)
    Prop.forAllNoShrink(operands) { case (width, mantissaBits, values) =>
      test(new NormaliseHarness(width, mantissaBits)) { unit =>
        for (x <- values) withClue(s"$width bits, mantissa of $mantissaBits bits, x $x: ") {
          unit.x.poke(x)
          val mantissa = unit.result.mantissa.peek().litValue
          val exponent = unit.result.exponent.peek().litValue.toInt
          if (x == 0) (mantissa, exponent) shouldBe ((BigInt(0), 0))
          else {
            mantissa.bitLength shouldBe mantissaBits
            // mantissa ≤ x / 2^(exponent - mantissaBits) < mantissa + 1
            assert(RoundingSpec.isFloor(mantissa, x, exponent - mantissaBits))
          }
        }
      }
      true
    }
  }
}
