package colonnade.numbers

import chiseltest._
import colonnade.Properties
import org.scalacheck.{Gen, Prop}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

class DividerSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers with Properties {
  behavior of "Divider"

  private def quotients(unit: Divider, operands: Seq[(BigInt, BigInt)], random: Random, stalls: Double): Seq[BigInt] =
    StreamTester.exchange(unit.clock, unit.io.division, unit.io.quotient, operands)(
      (bits, operand: (BigInt, BigInt)) => {
        bits.numerator.poke(operand._1)
        bits.denominator.poke(operand._2)
      },
      _.peek().litValue
    )(random, stalls)

  private def expected(operands: Seq[(BigInt, BigInt)], digits: Int): Seq[BigInt] =
    operands.map { case (numerator, denominator) => (numerator << digits) / denominator }

  for ((mantissaBits, digits) <- Seq((1, 0), (1, 3), (3, 0), (3, 1), (4, 2), (4, 5), (5, 4), (5, 9)))
    it should s"divide all $mantissaBits-bit mantissas to $digits digits" in {
      val mantissas = BigInt(1) << (mantissaBits - 1) until BigInt(1) << mantissaBits
      val operands  = for (n <- BigInt(0) +: mantissas; d <- mantissas) yield (n, d)
      for (digitsPerCycle <- 1 to 3) test(new Divider(mantissaBits, digits, digitsPerCycle)) { unit =>
        quotients(unit, operands, new Random(1), stalls = 0.2) shouldBe expected(operands, digits)
      }
    }

  for ((mantissaBits, digits) <- Seq((32, 32), (32, 18), (32, 31), (8, 30), (17, 16), (24, 8)))
    it should s"divide random and extreme $mantissaBits-bit mantissas to $digits digits, with stalls" in {
      val random   = new Random(2)
      val top      = BigInt(1) << (mantissaBits - 1)
      val extremes = Seq(top, top + 1, 2 * top - 2, 2 * top - 1)
      val operands =
        (for (n <- BigInt(0) +: extremes; d <- extremes) yield (n, d)) ++
          Seq.fill(150)((top | BigInt(mantissaBits - 1, random), top | BigInt(mantissaBits - 1, random)))
      for (digitsPerCycle <- 1 to 2) test(new Divider(mantissaBits, digits, digitsPerCycle)) { unit =>
        for (stalls <- Seq(0.0, 0.7))
          quotients(unit, operands, random, stalls) shouldBe expected(operands, digits)
      }
    }

  it should "give the floor of the exact quotient, at any width and number of digits" in holds(cases = 10) {
    def mantissa(bits: Int): Gen[BigInt] = Gen.choose(BigInt(1) << (bits - 1), (BigInt(1) << bits) - 1)
    val divisions                        = for {
      mantissaBits <- Gen.choose(1, 40)
      digits       <- Gen.choose(0, 40)
      operands     <- Gen.listOfN(12, Gen.zip(mantissa(mantissaBits), mantissa(mantissaBits)))
      stalls       <- Gen.oneOf(0.0, 0.5)
    } yield (mantissaBits, digits, operands, stalls)
    Prop.forAllNoShrink(divisions) { case (mantissaBits, digits, operands, stalls) =>
      test(new Divider(mantissaBits, digits)) { unit =>
        val found = quotients(unit, operands, new Random(1), stalls)
        for ((quotient, (numerator, denominator)) <- found.zip(operands))
          withClue(s"$numerator / $denominator, $mantissaBits bits, $digits digits: ") {
            assert(quotient * denominator <= (numerator << digits))
            assert((numerator << digits) < (quotient + 1) * denominator)
          }
      }
      true
    }
  }

  it should "take one division every steps + 1 cycles without stalls" in {
    test(new Divider(32, 18)) { unit =>
      unit.io.division.valid.poke(true)
      unit.io.division.bits.numerator.poke(BigInt(1) << 31)
      unit.io.division.bits.denominator.poke(BigInt(3) << 30)
      unit.io.quotient.ready.poke(true)
      val cycles = 20 * (Divider.steps(18) + 1)
      val taken  = (0 until cycles).count { _ =>
        val accepted = unit.io.division.ready.peekBoolean()
        unit.clock.step()
        accepted
      }
      taken shouldBe 20
    }
  }
}
