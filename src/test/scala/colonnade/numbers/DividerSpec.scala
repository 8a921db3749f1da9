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

class PipelinedDividerSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "PipelinedDivider"

  private type Operands = (BigInt, BigInt)

  /** A division a cycle, but when nothing loads: two lanes, the second one divides the numerators in reverse. */
  private def check(mantissaBits: Int, digits: Int, bitsPerStage: Int, operands: Seq[Operands]): Unit =
    test(new PipelinedDivider(mantissaBits, digits, lanes = 2, hasRest = true, bitsPerStage)) { divider =>
      divider.io.loads.foreach(_.poke(true))
      val random  = new Random(2)
      val latency = PipelinedDivider.stages(digits, bitsPerStage)
      val lanes   = operands.map(_._1).zip(operands.map(_._1).reverse)
      for (cycle <- 0 until operands.size + latency) {
        for (((one, other), (_, denominator)) <- lanes.lift(cycle).zip(operands.lift(cycle))) {
          divider.io.numerators(0).poke(one)
          divider.io.numerators(1).poke(other)
          divider.io.denominator.poke(denominator)
        }
        if (cycle >= latency) {
          val ((one, other), (_, denominator)) = (lanes(cycle - latency), operands(cycle - latency))
          for ((numerator, lane) <- Seq(one, other).zipWithIndex) {
            val (quotient, rest) = (numerator << digits) /% denominator
            divider.io.quotients(lane).expect(quotient)
            divider.io.rests.get(lane).expect(rest != 0)
          }
        }
        if (random.nextInt(4) == 0) {
          divider.io.loads.foreach(_.poke(false))
          divider.clock.step()
          divider.io.loads.foreach(_.poke(true))
        }
        divider.clock.step()
      }
    }

  private def mantissas(bits: Int) = BigInt(1) << (bits - 1) until BigInt(1) << bits

  for ((mantissaBits, digits, bits) <- Seq((2, 0, 2), (2, 5, 2), (3, 1, 2), (4, 2, 3), (5, 4, 2), (5, 9, 3)))
    it should s"divide all $mantissaBits-bit mantissas to $digits digits, $bits bits a stage" in
      check(
        mantissaBits,
        digits,
        bits,
        for (n <- BigInt(0) +: mantissas(mantissaBits); d <- mantissas(mantissaBits)) yield (n, d)
      )

  for ((mantissaBits, digits, bits) <- Seq((32, 30, 2), (32, 22, 3), (32, 18, 2), (8, 8, 3)))
    it should s"divide random and extreme $mantissaBits-bit mantissas to $digits digits, $bits bits a stage" in {
      val random   = new Random(1)
      val top      = BigInt(1) << (mantissaBits - 1)
      val extremes = Seq(top, top + 1, 2 * top - 2, 2 * top - 1)
      def any      = top | BigInt(mantissaBits - 1, random)
      check(
        mantissaBits,
        digits,
        bits,
        (for (n <- BigInt(0) +: extremes; d <- extremes) yield (n, d)) ++ Seq.fill(300)((any, any))
      )
    }
}

/** A division, whose denominator is `operand`, or a square root of `operand`. */
private final case class RootCase(operand: BigInt, numerator: Option[BigInt]) {

  /** By definition, not by an algorithm. */
  def isResult(result: BigInt, digits: Int): Boolean = numerator match {
    case Some(numerator) => result == (numerator << digits) / operand
    case None            => result * result <= operand && operand < (result + 1) * (result + 1)
  }
}

class RootDividerSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "RootDivider"

  for ((radicandBits, mantissaBits, digits) <- Seq((16, 8, 8), (16, 16, 16), (20, 20, 16), (32, 32, 16), (64, 32, 16)))
    it should s"take roots of $radicandBits bits and divide $mantissaBits-bit mantissas to $digits digits, in any order" in
      test(new RootDivider(radicandBits, mantissaBits, digits)) { unit =>
        val random             = new Random(5)
        def mantissa: BigInt   = (BigInt(1) << (mantissaBits - 1)) | BigInt(mantissaBits - 1, random)
        val highest            = BigInt(1) << (mantissaBits - 1)
        val max                = 2 * highest - 1
        def natural(bits: Int) = BigInt(random.nextInt(bits + 1), random)
        val squares            = Seq.fill(20)(BigInt(radicandBits / 2, random).pow(2))
        val radicands          = Seq(BigInt(0), BigInt(1), (BigInt(1) << radicandBits) - 1) ++
          Seq.fill(40)(natural(radicandBits)) ++ squares ++ squares.map(square => (square - 1).max(0))
        val divisions = Seq(highest -> highest, max -> highest, highest -> max, max -> max, BigInt(0) -> highest) ++
          Seq.fill(40)(mantissa -> mantissa)
        val cases = random.shuffle(
          radicands.map(RootCase(_, None)) ++ divisions.map { case (numerator, denominator) =>
            RootCase(denominator, Some(numerator))
          }
        )
        for (stalls <- Seq(0.0, 0.6)) {
          val results = StreamTester.exchange(unit.clock, unit.io.operation, unit.io.result, cases)(
            (port, operands: RootCase) => {
              port.isDivision.poke(operands.numerator.isDefined)
              port.operand.poke(operands.operand)
              port.numerator.poke(operands.numerator.getOrElse(BigInt(0)))
            },
            _.peek().litValue
          )(random, stalls)
          results.zip(cases).foreach { case (result, operands) =>
            assert(operands.isResult(result, digits), s"$result for $operands")
          }
        }
      }
}
