package colonnade.numbers

import chisel3._
import chiseltest._
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

class NormaliseSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
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
}
