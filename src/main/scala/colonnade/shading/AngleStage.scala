package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, PriorityEncoder, Reverse}
import colonnade.common.ModuloSchedule.{interval, xyz}
import colonnade.common.{ModuloSchedule, Timed}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{Light, Lobe}
import colonnade.numbers.{Normalise, Rounding}

/** Ports of [[AngleStage]]. Vectors come a component at a time, x first. */
final class AngleStageIO(config: PathConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new ShaderFormats(numbers)

  val phase     = Input(ModuloSchedule.phase())
  val lights    = Input(Vec(config.device.frame.lights, new Light(numbers)))
  val unitShift = Input(UInt(NumberFormats.bitLength(numbers.sceneBits).W))

  /** In cycles 5 to 7 and 17: the light's number. */
  val light        = Input(UInt(log2Ceil(config.device.frame.lights.max(2)).W))
  val lightFalloff = Input(UInt(log2Ceil(config.device.frame.lights.max(2)).W))

  val origin = Input(SInt(ShaderFormats.originBits(config).W)) // from cycle 6 on
  val normal = Input(SInt(formats.narrowBits.W))               // from `AngleCycles.normal` on

  /** From `AngleCycles.angle` on for three cycles, but the product of the lengths and their exponent in the fifth. */
  val angle = Output(new Angle(formats))

  val falloff       = Output(new FalloffRequest(numbers)) // in cycle 17
  val squaredNormal = Output(UInt(formats.dotBits.W))     // in the cycle before the angle: n·n
}

/** Cycles of [[AngleStage]]. */
final class AngleCycles(config: PathConfig) {
  val normal:  Int = Lobe(config.device).fold(7)(_ => LobeAxisStage.axis0)
  val dot:     Int = normal.max(12)
  val square:  Int = dot + 4
  val angle:   Int = dot + 5
  val lengths: Int = angle + 4
}

/** The vector from a point to a light, and its angle to the normal: docs/numbers.md, 5.4 to 5.6 and the product of 5.7.
  * An angle every three cycles, by three multipliers, one for each dot product, and one for the lengths, digit by
  * digit.
  */
final class AngleStage(config: PathConfig) extends Module {
  private val numbers   = config.numbers
  private val formats   = new ShaderFormats(numbers)
  private val shadeBits = formats.shadeBits
  private val cycles    = new AngleCycles(config)

  val io = IO(new AngleStageIO(config))

  private val schedule = new ModuloSchedule(io.phase)
  import schedule._

  private def entry(light: UInt): Light = io.lights(if (config.device.frame.lights == 1) 0.U else light)

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
  import cycles.{angle, dot, square}

  private def sum(left: SInt, right: SInt, first: Int): Timed[SInt] = {
    val product = latch(xyz(first))(left * right)
    accumulate(xyz(first + 1), product.at(xyz(first + 1)).pad(formats.dotBits + 1))(_ + _)
  }
  private val n  = delay(arriving(io.normal, xyz(cycles.normal)), xyz(cycles.normal), dot - cycles.normal).at(xyz(dot))
  private val l  = delay(light, xyz(12), dot - 12).at(xyz(dot))
  private val nn = sum(n, n, dot)
  private val nl = sum(n, l, dot)
  private val ll = sum(light.at(xyz(12)), light.at(xyz(12)), 12)

  private def normalisedAt(sum: Timed[SInt], cycle: Int): (Timed[SInt], Timed[UInt]) = {
    val (mantissa, exponent) = normalised(sum.at(cycle).asUInt)
    (latch(cycle)(mantissa.zext), latch(cycle)(exponent))
  }
  private val ofNormal    = normalisedAt(nn, square)
  private val ofLight     = normalisedAt(ll, 16)
  private val lightLater  = delayed(ofLight._1, 17, angle)
  private val normProduct = multiply(ofNormal._1, lightLater, angle)
  private val exponent    = latch(angle + 2)(ofNormal._2.at(angle + 2) +& delayed(ofLight._2, 17, angle).at(angle + 2))

  io.squaredNormal := nn.at(square).asUInt(formats.dotBits - 1, 0)

  io.angle.isAcute     := latch(square)(nl.at(square) > 0.S).at(angle)
  io.angle.dot         := latch(square)(nl.at(square).asUInt(formats.dotBits - 1, 0)).at(angle)
  io.angle.normProduct := normProduct.at(cycles.lengths).asUInt(formats.normProductBits - 1, 0)
  io.angle.exponent    := exponent.at(cycles.lengths)

  // The light's squared distance has 2 · shadeBits - 1 + exponent bits, after a left shift by twice the zeros
  private val scale       = 2 * (formats.toLightBits - 1 - shadeBits) + 2 * shadeBits - 1 - numbers.mantissaBits
  private val squaredBits = scale.S +& ofLight._2.at(17).zext -& (carry(zeros, 17).at(17) << 1).zext
  private val reach       = entry(io.lightFalloff)
  io.falloff.reference := reach.reachMantissa
  io.falloff.mantissa  := ofLight._1.at(17).asUInt(shadeBits - 1, 0)
  io.falloff.exponent  := reach.reachExponent -& squaredBits

  /** A value that is there for an interval from a cycle on, from a later one on. */
  private def delayed[T <: Data](value: Timed[T], from: Int, to: Int): Timed[T] =
    if (from == to) value
    else {
      val step = (to - from).min(interval)
      delayed(latch(from + step - 1)(value.at(from + step - 1)), from + step, to)
    }

  /** A squared length as a mantissa and an exponent, see [[Angle]]: the highest bit is one of the top four. */
  private def normalised(sum: UInt): (UInt, UInt) = {
    val top      = sum(formats.dotBits - 1, formats.dotBits - 4)
    val exponent = Mux(top(3, 1).orR, 3.U - PriorityEncoder(Reverse(top(3, 1))), 0.U)(1, 0)
    val mantissa = VecInit(Seq.tabulate(4)(k => sum(k + 2 * shadeBits - 2, k + shadeBits - 1)))(exponent)
    (mantissa, exponent)
  }
}
