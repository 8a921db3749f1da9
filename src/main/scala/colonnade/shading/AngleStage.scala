package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, PriorityEncoder, Reverse}
import colonnade.common.ModuloSchedule
import colonnade.common.ModuloSchedule.xyz
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.Light
import colonnade.numbers.{Normalise, Rounding}

/** Ports of [[AngleStage]]. Vectors come a component at a time, x first. */
final class AngleStageIO(config: PathConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new ShaderFormats(numbers)

  val phase     = Input(ModuloSchedule.phase())
  val lights    = Input(Vec(config.frame.lights, new Light(numbers)))
  val unitShift = Input(UInt(NumberFormats.bitLength(numbers.sceneBits).W))

  /** In cycles 5 to 7 and 17: the light's number. */
  val light        = Input(UInt(log2Ceil(config.frame.lights.max(2)).W))
  val lightFalloff = Input(UInt(log2Ceil(config.frame.lights.max(2)).W))

  /** From cycle 6 on, and from cycle 7 on. */
  val origin = Input(SInt(ShaderFormats.originBits(config).W))
  val normal = Input(SInt(formats.narrowBits.W))

  /** In cycles 17 to 19, but the product of the lengths and their exponent in cycle 21, and the falloff in cycle 17. */
  val angle   = Output(new Angle(formats))
  val falloff = Output(new FalloffRequest(numbers))

  val squaredNormal = Output(UInt(formats.dotBits.W)) // in cycle 16: n·n
}

/** The vector from a point to a light, and its angle to the normal: docs/numbers.md, 5.4 to 5.6 and the product of 5.7. An
  * angle every three cycles, by three multipliers, one for each dot product, and one for the lengths, digit by digit.
  */
final class AngleStage(config: PathConfig) extends Module {
  private val numbers   = config.numbers
  private val formats   = new ShaderFormats(numbers)
  private val shadeBits = formats.shadeBits

  val io = IO(new AngleStageIO(config))

  private val schedule = new ModuloSchedule(io.phase)
  import schedule._

  private def entry(light: UInt): Light = io.lights(if (config.frame.lights == 1) 0.U else light)

  // The vector to the light
  private val position = latch(xyz(5)) {
    val axes      = entry(io.light).position.axes
    val component = select(xyz(5))(axes(_))
    val inScene   = Rounding.narrow(component, numbers.sceneBits).pad(formats.toLightBits)
    (inScene << io.unitShift).asUInt(formats.toLightBits - 1, 0).asSInt
  }
  private val toLight = latch(xyz(6)) {
    Rounding.narrow((position.at(xyz(6)) - io.origin.pad(formats.toLightBits)), formats.toLightBits)
  }
  private val length = {
    val now = toLight.at(xyz(7))
    accumulate(xyz(7), Mux(now < 0.S, 0.S - now, now).asUInt(formats.toLightBits - 2, 0))(_ | _)
  }
  private val zeros = latch(10)(Normalise.countLeadingZeros(length.at(10))._2)
  private val light = latch(xyz(11)) {
    val scaled = (delay(toLight, xyz(7), 4).at(xyz(11)) << zeros.at(xyz(11))).asUInt(formats.toLightBits - 1, 0)
    scaled.head(formats.narrowBits).asSInt
  }

  // Dot products
  private val n               = delay(arriving(io.normal, xyz(7)), xyz(7), 5).at(xyz(12))
  private val l               = light.at(xyz(12))
  private val Seq(nn, nl, ll) = Seq((n, n), (n, l), (l, l)).map { case (left, right) =>
    val product = latch(xyz(12))(left * right)
    accumulate(xyz(13), product.at(xyz(13)).pad(formats.dotBits + 1))(_ + _)
  }
  private val Seq(ofNormal, ofLight) = Seq(nn, ll).map { sum =>
    val (mantissa, exponent) = normalised(sum.at(16).asUInt)
    (latch(16)(mantissa.zext), latch(16)(exponent))
  }
  private val normProduct = multiply(ofNormal._1, ofLight._1, 17)
  private val exponent    = latch(19)(ofNormal._2.at(19) +& ofLight._2.at(19))

  io.squaredNormal := nn.at(16).asUInt(formats.dotBits - 1, 0)

  io.angle.isAcute     := latch(16)(nl.at(16) > 0.S).at(17)
  io.angle.dot         := latch(16)(nl.at(16).asUInt(formats.dotBits - 1, 0)).at(17)
  io.angle.normProduct := normProduct.at(21).asUInt(formats.normProductBits - 1, 0)
  io.angle.exponent    := exponent.at(21)

  // The light's squared distance has 2 · shadeBits - 1 + exponent bits, after a left shift by twice the zeros
  private val scale       = 2 * (formats.toLightBits - 1 - shadeBits) + 2 * shadeBits - 1 - numbers.mantissaBits
  private val squaredBits = scale.S +& ofLight._2.at(17).zext -& (carry(zeros, 17).at(17) << 1).zext
  private val reach       = entry(io.lightFalloff)
  io.falloff.reference := reach.reachMantissa
  io.falloff.mantissa  := ofLight._1.at(17).asUInt(shadeBits - 1, 0)
  io.falloff.exponent  := reach.reachExponent -& squaredBits

  /** A squared length as a mantissa and an exponent, see [[Angle]]: the highest bit is one of the top four. */
  private def normalised(sum: UInt): (UInt, UInt) = {
    val top      = sum(formats.dotBits - 1, formats.dotBits - 4)
    val exponent = Mux(top(3, 1).orR, 3.U - PriorityEncoder(Reverse(top(3, 1))), 0.U)(1, 0)
    val mantissa = VecInit(Seq.tabulate(4)(k => sum(k + 2 * shadeBits - 2, k + shadeBits - 1)))(exponent)
    (mantissa, exponent)
  }
}
