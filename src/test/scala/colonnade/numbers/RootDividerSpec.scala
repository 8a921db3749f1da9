package colonnade.numbers

import chiseltest._
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

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
