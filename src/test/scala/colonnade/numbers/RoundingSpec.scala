package colonnade.numbers

import chisel3._
import chiseltest._
import colonnade.Properties
import org.scalacheck.{Gen, Prop}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

/** All roundings of one operand, signed and unsigned. */
private class RoundingHarness(width: Int, amounts: Seq[Int]) extends Module {
  val signed   = IO(Input(SInt(width.W)))
  val unsigned = IO(Input(UInt(width.W)))

  private def shown[T <: Data](value: T): T = {
    val port = IO(Output(chiselTypeOf(value)))
    port := value
    port
  }

  val floors           = amounts.map(n => shown(Rounding.floor(signed, n)))
  val unsignedFloors   = amounts.map(n => shown(Rounding.floor(unsigned, n)))
  val nearests         = amounts.map(n => shown(Rounding.nearestEven(signed, n)))
  val unsignedNearests = amounts.map(n => shown(Rounding.nearestEven(unsigned, n)))
  val saturated        = (1 to width + 1).map(bits => shown(Rounding.saturate(signed, bits)))
  val unsignedSaturate = (1 to width + 1).map(bits => shown(Rounding.saturate(unsigned, bits)))
  val between          = RoundingSpec.ranges.map { case (low, high) => shown(Rounding.saturate(signed, low, high)) }
}

class RoundingSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers with Properties {
  import RoundingSpec._

  behavior of "Rounding"

  for (width <- Seq(1, 2, 5, 6))
    it should s"agree with exact arithmetic for every $width-bit number and amount" in {
      val amounts = -2 to width + 2
      test(new RoundingHarness(width, amounts)) { unit =>
        for (bits <- 0 until 1 << width) {
          val x = BigInt(if (bits >= (1 << (width - 1))) bits - (1 << width) else bits)
          unit.signed.poke(x)
          unit.unsigned.poke(bits)
          for ((n, i) <- amounts.zipWithIndex) withClue(s"x $x (unsigned $bits), $n bits: ") {
            unit.floors(i).peek().litValue shouldBe floor(x, n)
            unit.unsignedFloors(i).peek().litValue shouldBe floor(bits, n)
            unit.nearests(i).peek().litValue shouldBe nearestEven(x, n)
            unit.unsignedNearests(i).peek().litValue shouldBe nearestEven(bits, n)
          }
          for (to <- 1 to width + 1) withClue(s"x $x (unsigned $bits) to $to bits: ") {
            val half = BigInt(1) << (to - 1)
            unit.saturated(to - 1).peek().litValue shouldBe x.max(-half).min(half - 1)
            unit.unsignedSaturate(to - 1).peek().litValue shouldBe BigInt(bits).min(2 * half - 1)
          }
          for (((low, high), port) <- ranges.zip(unit.between)) withClue(s"x $x to $low..$high: ") {
            port.peek().litValue shouldBe x.max(low).min(high)
          }
        }
      }
    }

  it should "give the integer next to x / 2^n, at any width and amount" in holds(cases = 12) {
    val operands = for {
      width   <- Gen.choose(1, 80)
      amounts <- Gen.listOfN(3, Gen.choose(-8, width + 8))
      values  <- Gen.listOfN(20, signed(width))
    } yield (width, amounts, values)
    Prop.forAllNoShrink(operands) { case (width, amounts, values) =>
      test(new RoundingHarness(width, amounts)) { unit =>
        for (x <- values) {
          val natural = x + (BigInt(1) << (width - 1))
          unit.signed.poke(x)
          unit.unsigned.poke(natural)
          for ((n, i) <- amounts.zipWithIndex) withClue(s"$width bits, x $x (unsigned $natural), $n bits: ") {
            assert(isFloor(unit.floors(i).peek().litValue, x, n))
            assert(isFloor(unit.unsignedFloors(i).peek().litValue, natural, n))
            assert(isNearestEven(unit.nearests(i).peek().litValue, x, n))
            assert(isNearestEven(unit.unsignedNearests(i).peek().litValue, natural, n))
          }
        }
      }
      true
    }
  }

  it should "keep no more bits than the result needs" in {
    test(new RoundingHarness(6, Seq(2))) { unit =>
      unit.floors.head.getWidth shouldBe 4
      unit.nearests.head.getWidth shouldBe 5
      unit.saturated(2).getWidth shouldBe 3
      unit.between.head.getWidth shouldBe 4
    }
  }
}

private object RoundingSpec {
  val ranges: Seq[(BigInt, BigInt)] =
    Seq[(Int, Int)]((-4, 7), (0, 5), (-7, -3), (3, 3), (9, 20), (-100, 100)).map { case (a, b) =>
      (BigInt(a), BigInt(b))
    }

  /** Numbers of every length, so that small ones are as frequent as large ones. */
  def signed(width: Int): Gen[BigInt] = for {
    length <- Gen.choose(0, width - 1)
    bits   <- Gen.choose(BigInt(0), (BigInt(1) << length) - 1)
    sign   <- Gen.oneOf(true, false)
  } yield if (sign) -bits - 1 else bits

  /** result ≤ x / 2^n < result + 1, scaled to integers. */
  def isFloor(result: BigInt, x: BigInt, n: Int): Boolean = {
    val (whole, step) = (x << (-n).max(0), BigInt(1) << n.max(0))
    result * step <= whole && whole < (result + 1) * step
  }

  /** |result - x / 2^n| ≤ ½, and the result is even if that is ½. */
  def isNearestEven(result: BigInt, x: BigInt, n: Int): Boolean = {
    val (whole, step) = (x << (-n).max(0), BigInt(1) << n.max(0))
    val twice         = 2 * (result * step - whole).abs
    twice < step || (twice == step && !result.testBit(0))
  }

  /** By integer division, corrected from truncation to floor. */
  def floor(x: BigInt, bits: Int): BigInt =
    if (bits <= 0) x << -bits
    else {
      val step = BigInt(1) << bits
      (x - x.mod(step)) / step
    }

  def nearestEven(x: BigInt, bits: Int): BigInt =
    if (bits <= 0) x << -bits
    else {
      val step  = BigInt(1) << bits
      val below = floor(x, bits)
      val twice = 2 * (x - below * step)
      if (twice > step || (twice == step && below.testBit(0))) below + 1 else below
    }
}
