package colonnade.numbers

import chisel3._
import chiseltest._
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

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
