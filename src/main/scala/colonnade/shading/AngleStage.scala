package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, PriorityEncoder, Reverse}
import colonnade.common.ModuloSchedule
import colonnade.common.ModuloSchedule.xyz
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.Light
import colonnade.numbers.{Normalise, Rounding}

/** Ports of [[AngleStage]]. Vectors come a component at a time, x first. */
final class AngleStageIO(config: ColonnadeConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new ShaderFormats(numbers)

  val phase     = Input(UInt(2.W))
  val lights    = Input(Vec(config.frame.lights, new Light(numbers)))
  val unitShift = Input(UInt(NumberFormats.bitLength(numbers.sceneBits).W))

  /** In cycles 6 to 9 and 18: the light's number. */
  val light        = Input(UInt(log2Ceil(config.frame.lights.max(2)).W))
  val lightFalloff = Input(UInt(log2Ceil(config.frame.lights.max(2)).W))

  /** From cycle 7 on. */
  val origin = Input(SInt(ShaderFormats.originBits(config).W))
  val normal = Input(SInt(formats.narrowBits.W))

  /** In cycles 18 to 21, but the product of the lengths in cycle 21, and the falloff in cycle 18. */
  val angle   = Output(new Angle(formats))
  val falloff = Output(new FalloffRequest(numbers))
}

/** The vector from a point to a light, and its angle to the normal: docs/numbers.md, 5.4 to 5.6 and the product of 5.7. An
  * angle every four cycles, by three multipliers, one for each dot product; the one of n·n also multiplies the lengths.
  */
final class AngleStage(config: ColonnadeConfig) extends Module {
  private val numbers   = config.numbers
  private val formats   = new ShaderFormats(numbers)
  private val shadeBits = formats.shadeBits

  val io = IO(new AngleStageIO(config))

  private val schedule = new ModuloSchedule(io.phase)
  import schedule._

  private def entry(light: UInt): Light = io.lights(if (config.frame.lights == 1) 0.U else light)

  // The vector to the light
  private val position = latch(xyz(6)) {
    val axes      = entry(io.light).position.axes
    val component = select(xyz(6))(axes(_))
    val inScene   = Rounding.narrow(component, numbers.sceneBits).pad(formats.toLightBits)
    (inScene << io.unitShift).asUInt(formats.toLightBits - 1, 0).asSInt
  }
  private val toLight = latch(xyz(7)) {
    Rounding.narrow((position.at(xyz(7)) - io.origin.pad(formats.toLightBits)), formats.toLightBits)
  }
  private val length = {
    val now = toLight.at(xyz(8))
    accumulate(xyz(8), Mux(now < 0.S, 0.S - now, now).asUInt(formats.toLightBits - 2, 0))(_ | _)
  }
  private val zeros = latch(11)(Normalise.countLeadingZeros(length.at(11))._2)
  private val light = latch(xyz(12)) {
    val scaled = (delay(toLight, xyz(8), 4).at(xyz(12)) << zeros.at(xyz(12))).asUInt(formats.toLightBits - 1, 0)
    scaled.head(formats.narrowBits).asSInt
  }

  // Dot products
  private val normal  = delay(arriving(io.normal, xyz(7)), xyz(7), 6)
  private val (n, l)  = (normal.at(xyz(13)), light.at(xyz(13)))
  private val lengths = Wire(Vec(2, SInt(formats.narrowBits.W)))
  private val square  = latch(xyz(13) :+ 20) {
    val Seq(left, right) = lengths.map(length => Mux(isAt(20), length, n))
    left * right
  }
  private val Seq(nl, ll)           = Seq(n, l).map(factor => latch(xyz(13))(factor * l))
  private val Seq(nn, dot, squared) = Seq(square.items(0, 1, 2), nl, ll).map { product =>
    accumulate(xyz(14), product.at(xyz(14)).pad(formats.dotBits + 1))(_ + _)
  }
  private val Seq(ofNormal, ofLight) = Seq(nn, squared).map { sum =>
    val (mantissa, exponent) = normalised(sum.at(17).asUInt)
    (latch(17)(mantissa), latch(17)(exponent))
  }
  lengths := VecInit(Seq(ofNormal, ofLight).map(_._1.at(20).zext))

  io.angle.isAcute     := latch(17)(dot.at(17) > 0.S).at(18)
  io.angle.dot         := latch(17)(dot.at(17).asUInt(formats.dotBits - 1, 0)).at(18)
  io.angle.normProduct := square.items(3).at(21).asUInt(formats.normProductBits - 1, 0)
  io.angle.exponent    := ofNormal._2.at(18) +& ofLight._2.at(18)

  // The light's squared distance has 2 · shadeBits - 1 + exponent bits, after a left shift by twice the zeros
  private val scale       = 2 * (formats.toLightBits - 1 - shadeBits) + 2 * shadeBits - 1 - numbers.mantissaBits
  private val squaredBits = scale.S +& ofLight._2.at(18).zext -& (carry(zeros, 18).at(18) << 1).zext
  private val reach       = entry(io.lightFalloff)
  io.falloff.reference := reach.reachMantissa
  io.falloff.mantissa  := ofLight._1.at(18)
  io.falloff.exponent  := reach.reachExponent -& squaredBits

  /** A squared length as a mantissa and an exponent, see [[Angle]]: the highest bit is one of the top four. */
  private def normalised(sum: UInt): (UInt, UInt) = {
    val top      = sum(formats.dotBits - 1, formats.dotBits - 4)
    val exponent = Mux(top(3, 1).orR, 3.U - PriorityEncoder(Reverse(top(3, 1))), 0.U)(1, 0)
    val mantissa = VecInit(Seq.tabulate(4)(k => sum(k + 2 * shadeBits - 2, k + shadeBits - 1)))(exponent)
    (mantissa, exponent)
  }
}
