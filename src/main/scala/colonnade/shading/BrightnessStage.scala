package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Cat}
import colonnade.common.ModuloSchedule.{interval, xyz}
import colonnade.common.{ModuloSchedule, Timed}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{FrameRegisters, Lobe, Rgb}
import colonnade.numbers.{Fixed, FoldedDivider, FoldedSquareRoot, Normalise, Rounding, SquareRoot}

final class BrightnessStageIO(config: PathConfig) extends Bundle {
  private val numbers                                  = config.numbers
  private val formats                                  = new ShaderFormats(numbers)
  private def rough[T <: Data](field: => T): Option[T] = Lobe(config.device).map(_ => Input(field))

  val phase = Input(ModuloSchedule.phase())

  /** As [[AngleStage]] offers them. */
  val angle   = Input(new Angle(formats))
  val falloff = Input(new FalloffRequest(numbers))

  val colour = Input(Rgb(FrameRegisters.intensity))  // of the light, in three cycles from `BrightnessCycles.colour` on
  val direct = Output(Rgb(FrameRegisters.intensity)) // in the third cycle after

  /** From `BrightnessCycles.cosine` on for three cycles: whether the surface is rough metal. One cycle later its slope,
    * and eight cycles later its peak.
    */
  val isRough = rough(Bool())
  val slope   = rough(UInt(Lobe.slopeBits.W))
  val peak    = rough(UInt(Lobe.peakBits.W))
}

/** Cycles of [[BrightnessStage]]. */
final class BrightnessCycles(config: PathConfig) {
  private val numbers = config.numbers

  val falloff:  Int = 17
  val angle:    Int = new AngleCycles(config).angle
  val radicand: Int = new AngleCycles(config).lengths
  val root:     Int = radicand + 1 + interval * FoldedSquareRoot.intervals(numbers.radicandBits, interval)

  private val division = 1 + interval * FoldedDivider.intervals(numbers.cosineFraction, interval)
  val quotient:        Int = root + division
  val falloffQuotient: Int = falloff + division
  val cosine:          Int = quotient + 1
  val brightness:      Int = cosine + Lobe(config.device).fold(0)(_ => LobeStage.latency)
  val colour:          Int = brightness + interval + 1
  val direct:          Int = colour + 3
}

/** The cosine of an angle, the light's falloff and the light that arrives: docs/numbers.md, 5.7 and 5.8. An angle every
  * three cycles, by a square root, two dividers, a multiplier for the brightness, digit by digit, and one for the three
  * channels.
  */
final class BrightnessStage(config: PathConfig) extends Module {
  private val numbers   = config.numbers
  private val formats   = new ShaderFormats(numbers)
  private val cycles    = new BrightnessCycles(config)
  private val fraction  = numbers.cosineFraction
  private val shadeBits = formats.shadeBits

  val io = IO(new BrightnessStageIO(config))

  private val schedule = new ModuloSchedule(io.phase)
  import schedule._

  // The dot product with its top bit set
  private val angle      = cycles.angle
  private val dot        = arriving(io.angle.dot, angle, angle + interval - 1)
  private val dotZeros   = latch(angle)(Normalise.countLeadingZeros(dot.at(angle))._2)
  private val dotBits    = numbers.mantissaBits.min(formats.dotBits)
  private val isAcute    = arriving(io.angle.isAcute, angle, angle + interval - 1)
  private val normalised = latch(angle + 1) {
    (dot.at(angle + 1) << dotZeros.at(angle + 1))(formats.dotBits - 1, formats.dotBits - dotBits)
  }

  // The root. One of the product's two top bits is set, and the exponent is made even
  private val isLong   = io.angle.normProduct(formats.normProductBits - 1)
  private val aligned  = Mux(isLong, io.angle.normProduct, (io.angle.normProduct << 1)(formats.normProductBits - 1, 0))
  private val mantissa = Rounding.floor(aligned, formats.normProductBits - numbers.radicandBits)
  private val exponent = io.angle.exponent +& isLong
  private val root     = Module(new FoldedSquareRoot(numbers.radicandBits, interval)).io
  root.isStep   := isAt(cycles.radicand)
  root.radicand := Mux(exponent(0), mantissa, mantissa >> 1)

  // The cosine: twice the quotient, moved down by two bits less than the exponents say
  private val rootBits = SquareRoot.rootBits(numbers.radicandBits)
  private val down     = latch(cycles.radicand)(exponent(3, 1) +& carry(dotZeros, cycles.radicand).at(cycles.radicand))
  private val quotient = divide(
    cycles.root,
    carry(normalised, cycles.root).at(cycles.root),
    root.root.head(rootBits.min(numbers.mantissaBits))
  )
  private val isAcuteThen = carry(isAcute, cycles.quotient)
  private val cosine      = latch(cycles.quotient) {
    val exponent = carry(down, cycles.quotient).at(cycles.quotient)
    val cosine   = (quotient << 1).asUInt >> Mux(exponent > 2.U, exponent - 2.U, 0.U)
    val limited  = Mux(cosine(fraction + 1, fraction).orR, (BigInt(1) << fraction).U, cosine(fraction, 0))
    Mux(isAcuteThen.at(cycles.quotient), limited, 0.U)
  }

  // At rough metal a light has another share
  private val share = io.isRough.fold(arriving(cosine.at(cycles.cosine).zext, cosine.first, cosine.last)) { isRough =>
    val lobe = Module(new LobeStage(numbers, cycles.cosine)).io
    lobe.phase  := io.phase
    lobe.cosine := cosine.at(cycles.cosine)
    lobe.slope  := io.slope.get
    lobe.peak   := io.peak.get
    val first = cycles.brightness
    val flags =
      latch(cycles.cosine)(Cat(isRough, latch(cycles.quotient)(isAcuteThen.at(cycles.quotient)).at(cycles.cosine)))

    def late[T <: Data](value: Timed[T]): T = carry(value, first - 1).at(first - 1)
    val spread                              = arriving(lobe.share, first, first + interval - 1)
    val kept                                = latch(first - 1)(Cat(late(flags), late(cosine)))
    val now                                 = kept.at(first)
    val light = Mux(now(fraction + 2), Mux(now(fraction + 1), spread.at(first), 0.U), now(fraction, 0))
    arriving(light.zext, first, first + interval - 1)
  }

  // The falloff: its quotient has guard bits below, so that it only has to move down
  private val guardBits   = (NumberFormats.lightFraction + 3 - fraction).max(0)
  private val falloffBits = (fraction + 1 + guardBits).max(Falloff.bits)
  private val shift       = latch(17)((fraction - NumberFormats.lightFraction + guardBits).S -& io.falloff.exponent)
  private val amountBits  = log2Ceil(falloffBits + 1)
  private val most        = (1 << amountBits) - 1
  private val amount      = latch(18)(Mux(shift.at(18) > most.S, most.U, shift.at(18).asUInt(amountBits - 1, 0)))
  private val isNear      = latch(18)(shift.at(18) < 0.S)
  private val isConstant  = latch(17)(io.falloff.reference === 0.U)
  private val ratio       =
    divide(cycles.falloff, io.falloff.reference, io.falloff.mantissa.head(shadeBits.min(numbers.mantissaBits)))
  private val falloff = latch(cycles.falloffQuotient) {
    def now[T <: Data](value: Timed[T]): T = carry(value, cycles.falloffQuotient).at(cycles.falloffQuotient)
    val moved                              = (ratio << guardBits).asUInt.pad(falloffBits) >> now(amount)
    val limited = Mux(now(isNear) || moved > Falloff.max, Falloff.max, moved(Falloff.bits - 1, 0))
    Mux(now(isConstant), Falloff.one, limited)
  }

  // The products
  private val before      = cycles.brightness - 1
  private val falloffThen = latch(before)(carry(falloff, before).at(before).zext)
  private val product     = multiply(share, falloffThen, cycles.brightness)
  private val scaled      = Rounding.saturate(
    Rounding.floor(product.at(cycles.colour).asUInt, NumberFormats.lightFraction),
    formats.brightnessBits
  )
  private val colours    = xyz(cycles.colour)
  private val brightness = Mux(isAt(cycles.colour), scaled, latch(cycles.colour)(scaled).at(colours.tail))
  private val lit        = latch(colours)(brightness * select(colours)(io.colour.channels(_).natural))
  private val channel    =
    Rounding.saturate(Rounding.floor(lit.at(xyz(cycles.colour + 1)), fraction), NumberFormats.lightBits)
  private val channels = Seq.tabulate(2)(index => latch(colours(index) + 1)(channel).at(cycles.direct)) :+ channel
  io.direct.channels.zip(channels).foreach { case (to, from) => to := Fixed(to.format, from) }

  /** The quotient of two mantissas that are there in a cycle. */
  private def divide(cycle: Int, numerator: UInt, denominator: UInt): UInt = {
    val divider = Module(new FoldedDivider(numerator.getWidth, denominator.getWidth, fraction, interval)).io
    divider.isStep      := isAt(cycle)
    divider.numerator   := numerator
    divider.denominator := denominator
    divider.quotient
  }
}
