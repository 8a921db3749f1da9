package colonnade.numbers

import chisel3._
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

/** [[FoldedDivider]] and [[FoldedSquareRoot]]: an operation every three cycles, whose operands are there for one. */
class FoldedUnitsSpec extends AnyFlatSpec with ChiselScalatestTester {
  private val interval = 3

  /** Steps of a clock for a unit; `offer` gives it the operands, or others that it must not take. */
  private def feed[X](clock: Clock, isStep: Bool, inputs: Seq[X], intervals: Int)(
      offer:  Option[X] => Unit,
      result: () => BigInt
  ): Seq[BigInt] =
    for (index <- 0 until inputs.size + intervals) yield {
      val value = for (cycle <- 0 until interval) yield {
        isStep.poke(cycle == 0)
        offer(inputs.lift(index).filter(_ => cycle == 0))
        clock.step()
        result()
      }
      assert(value.distinct.size == 1, "a result stays for an interval")
      value.head
    }

  behavior of "FoldedDivider"

  for (
    (numeratorBits, denominatorBits, digits) <-
      Seq((32, 18, 16), (32, 16, 16), (20, 18, 16), (8, 16, 8), (10, 10, 10), (38, 5, 3))
  )
    it should s"divide $numeratorBits by $denominatorBits bits to $digits digits" in
      test(new FoldedDivider(numeratorBits, denominatorBits, digits, interval)) { dut =>
        val random              = new Random(1)
        def mantissa(bits: Int) = (BigInt(1) << (bits - 1)) + (random.nextInt(4) match {
          case 0 => BigInt(0)
          case 1 => (BigInt(1) << (bits - 1)) - 1
          case _ => BigInt(bits - 1, random)
        })
        val divisions = Seq.fill(200)((mantissa(numeratorBits), mantissa(denominatorBits)))
        val intervals = FoldedDivider.intervals(digits, interval)
        val quotients = feed(dut.clock, dut.io.isStep, divisions, intervals)(
          division => {
            dut.io.numerator.poke(division.map(_._1).getOrElse(mantissa(numeratorBits)))
            dut.io.denominator.poke(division.map(_._2).getOrElse(mantissa(denominatorBits)))
          },
          () => dut.io.quotient.peekInt()
        )
        for (((numerator, denominator), quotient) <- divisions.zip(quotients.drop(intervals)))
          assert(
            quotient == (numerator << (digits + denominatorBits)) / (denominator << numeratorBits),
            s"of $numerator and $denominator"
          )
      }

  behavior of "FoldedSquareRoot"

  for (bits <- Seq(16, 20, 32, 64))
    it should s"take roots of $bits bits" in test(new FoldedSquareRoot(bits, interval)) { dut =>
      val random    = new Random(2)
      val radicands = Seq.fill(200)(BigInt(random.nextInt(bits) + 1, random)) ++ Seq(BigInt(0), (BigInt(1) << bits) - 1)
      val intervals = FoldedSquareRoot.intervals(bits, interval)
      val roots     = feed(dut.clock, dut.io.isStep, radicands, intervals)(
        radicand => dut.io.radicand.poke(radicand.getOrElse(BigInt(bits, random))),
        () => dut.io.root.peekInt()
      )
      for ((radicand, root) <- radicands.zip(roots.drop(intervals)))
        assert(root * root <= radicand && (root + 1) * (root + 1) > radicand, s"of $radicand")
    }
}
