package colonnade.numbers

import chiseltest._
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

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
