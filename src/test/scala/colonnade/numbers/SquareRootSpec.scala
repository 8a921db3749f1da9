package colonnade.numbers

import chiseltest._
import colonnade.Properties
import org.scalacheck.{Gen, Prop}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

class SquareRootSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers with Properties {
  behavior of "SquareRoot"

  private def roots(unit: SquareRoot, radicands: Seq[BigInt], random: Random, stalls: Double): Seq[BigInt] =
    StreamTester.exchange(unit.clock, unit.io.radicand, unit.io.root, radicands)(
      (bits, radicand: BigInt) => bits.poke(radicand),
      _.peek().litValue
    )(random, stalls)

  /** By definition, not by an algorithm. */
  private def isFloorOfRoot(root: BigInt, radicand: BigInt): Boolean =
    root * root <= radicand && radicand < (root + 1) * (root + 1)

  for (bits <- Seq(1, 2, 5, 8, 10))
    it should s"find the root of every $bits-bit number" in {
      val radicands = BigInt(0) until BigInt(1) << bits
      test(new SquareRoot(bits)) { unit =>
        val found = roots(unit, radicands, new Random(3), stalls = 0.2)
        found.zip(radicands).foreach { case (root, radicand) => assert(isFloorOfRoot(root, radicand), radicand) }
      }
    }

  for (bits <- Seq(16, 32, 47, 64))
    it should s"find the root of random $bits-bit numbers and of those next to squares, with stalls" in {
      val random    = new Random(4)
      val largest   = (BigInt(1) << bits) - 1
      val squares   = Seq.fill(30)(BigInt(SquareRoot.rootBits(bits), random).pow(2)).filter(_ <= largest)
      val radicands =
        Seq(BigInt(0), BigInt(1), largest) ++ Seq.fill(60)(BigInt(bits, random)) ++ squares ++ squares.map(_ - 1)
      val possible = radicands.filter(_ >= 0)
      test(new SquareRoot(bits)) { unit =>
        for (stalls <- Seq(0.0, 0.7)) {
          val found = roots(unit, possible, random, stalls)
          found.zip(possible).foreach { case (root, radicand) => assert(isFloorOfRoot(root, radicand), radicand) }
        }
      }
    }

  it should "find the floor of the exact root, at any width" in holds(cases = 10) {
    val numbers = for {
      bits      <- Gen.choose(1, 70)
      radicands <- Gen.listOfN(12, RoundingSpec.signed(bits + 1).map(_.abs.min((BigInt(1) << bits) - 1)))
      stalls    <- Gen.oneOf(0.0, 0.5)
    } yield (bits, radicands, stalls)
    Prop.forAllNoShrink(numbers) { case (bits, radicands, stalls) =>
      test(new SquareRoot(bits)) { unit =>
        val found = roots(unit, radicands, new Random(1), stalls)
        for ((root, radicand) <- found.zip(radicands)) assert(isFloorOfRoot(root, radicand), s"$bits bits: $radicand")
      }
      true
    }
  }
}
