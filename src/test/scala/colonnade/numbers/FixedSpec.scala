package colonnade.numbers

import chisel3._
import chisel3.util.{Decoupled, Queue}
import chiseltest._
import circt.stage.ChiselStage
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import java.math.MathContext
import scala.util.Random

private class ArithmeticHarness(left: FixedPointFormat, right: FixedPointFormat) extends Module {
  val a = IO(Input(new Fixed(left)))
  val b = IO(Input(new Fixed(right)))

  private def shown(value: Fixed): Fixed = {
    val port = IO(Output(chiselTypeOf(value)))
    port := value
    port
  }

  val sum        = shown(a + b)
  val difference = shown(a - b)
  val product    = shown(a * b)
  val negated    = shown(-a)
  val saturated  = shown(Rounding.saturate(a, right))
  val less       = IO(Output(Bool()))
  val notMore    = IO(Output(Bool()))
  less    := a < b
  notMore := a <= b
}

class FixedSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "Fixed"

  private val distance = FixedPointFormat.signed(width = 32, fraction = 13)
  private val colour   = FixedPointFormat.unsigned(width = 16, fraction = 12)
  private val coarse   = FixedPointFormat.signed(width = 16, fraction = -3)
  private val slope    = FixedPointFormat.signed(width = 10, fraction = 12) // narrower than `colour`

  it should "be labelled by integer and fraction bits" in {
    distance.label shouldBe "q18_13"
    colour.label shouldBe "uq4_12"
    coarse.label shouldBe "q18_m3"
  }

  it should "refuse to connect two formats" in {
    an[Exception] should be thrownBy ChiselStage.emitCHIRRTL(new RawModule {
      val from = IO(Input(new Fixed(distance)))
      val to   = IO(Output(new Fixed(distance.copy(fraction = 12))))
      to := from
    })
  }

  it should "refuse to round into a format that is too narrow" in {
    an[IllegalArgumentException] should be thrownBy ChiselStage.emitCHIRRTL(new RawModule {
      val from = IO(Input(new Fixed(distance)))
      Rounding.floor(from, FixedPointFormat.signed(width = 26, fraction = 8))
    })
  }

  it should "pass through a queue" in {
    test(new Module {
      val in  = IO(Flipped(Decoupled(new Fixed(distance))))
      val out = IO(Decoupled(new Fixed(distance)))
      out :<>= Queue(in)
    }) { unit =>
      unit.in.valid.poke(true)
      unit.in.bits.elements(distance.label).asInstanceOf[SInt].poke(-5)
      unit.clock.step()
      unit.out.valid.expect(true)
      unit.out.bits.elements(distance.label).asInstanceOf[SInt].expect(-5)
    }
  }

  private val pairs =
    Seq((distance, coarse), (colour, colour), (distance, colour), (colour, coarse), (colour, slope), (slope, colour))
  for ((left, right) <- pairs)
    it should s"compute exactly with $left and $right" in {
      val random                                        = new Random(6)
      def values(format: FixedPointFormat): Seq[BigInt] =
        Seq(format.lowest, format.highest, BigInt(0)) ++ Seq.fill(8)(BigInt(format.width, random) + format.lowest)

      test(new ArithmeticHarness(left, right)) { unit =>
        for (x <- values(left); y <- values(right)) withClue(s"$x, $y: ") {
          poke(unit.a, x)
          poke(unit.b, y)
          val (a, b) = (value(x, left), value(y, right))
          peek(unit.sum) shouldBe a + b
          peek(unit.difference) shouldBe a - b
          peek(unit.product) shouldBe a * b
          peek(unit.negated) shouldBe -a
          peek(unit.saturated) shouldBe {
            val rounded = RoundingSpec.floor(x, left.fraction - right.fraction)
            value(rounded.max(right.lowest).min(right.highest), right)
          }
          unit.less.expect(a < b)
          unit.notMore.expect(a <= b)
        }
      }
    }

  /** Exact, since a power of two divides one of ten. */
  private def value(raw: BigInt, format: FixedPointFormat): BigDecimal =
    if (format.fraction <= 0) BigDecimal(raw << -format.fraction, MathContext.UNLIMITED)
    else BigDecimal(raw * BigInt(5).pow(format.fraction), format.fraction, MathContext.UNLIMITED)

  private def peek(number: Fixed): BigDecimal = value(number.raw.peek().litValue, number.format)

  private def poke(number: Fixed, raw: BigInt): Unit = number.raw match {
    case signed: SInt   => signed.poke(raw)
    case unsigned: UInt => unsigned.poke(raw)
    case _              => fail("a raw number is an SInt or a UInt")
  }
}

/** Raw integers for ports of type [[Fixed]]. */
object FixedPorts {
  implicit final class FixedPort(port: Fixed) {
    def pokeRaw(raw: BigInt): Unit = port.raw match {
      case signed: SInt   => signed.poke(raw)
      case unsigned: UInt => unsigned.poke(raw)
      case other          => throw new IllegalArgumentException(s"$other is no raw number")
    }

    def peekRaw(): BigInt = port.raw.peek().litValue
  }
}
