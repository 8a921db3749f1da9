package colonnade.instance

import chisel3._
import chisel3.util.{Cat, RegEnable, Valid}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.ObjectInstance
import colonnade.numbers.{Fixed, Normalise, PipelinedDivider, Rounding}
import colonnade.ray.RayFormats

/** A hit's distance along an object's ray, which enters the cube at `tEntry` and hits at `t`. */
final class ObjectDistance(config: PathConfig) extends Bundle {
  private val formats = new RayFormats(config.numbers)

  val tEntry = new Fixed(formats.entry)
  val t      = new Fixed(formats.grid)
  val scale  = new ObjectScale(config.numbers)
}

final class WorldDistanceIO(config: PathConfig) extends Bundle {
  val distance = Flipped(Valid(new ObjectDistance(config)))
  val t        = Valid(new Fixed(new RayFormats(config.numbers).grid))
}

/** Finds a distance along the ray of the world each cycle, by a division; in `latency` cycles. Source:
  * docs/numbers.md, section 10.
  */
final class WorldDistance(config: PathConfig) extends Module {
  private val numbers  = config.numbers
  private val grid     = numbers.gridBits
  private val digits   = numbers.distanceDigits
  private val mantissa = ObjectScale.mantissaBits(numbers)

  val io = IO(new WorldDistanceIO(config))

  // Stages: sum, mantissa, division, shift. Those after the first one hold still if it does
  private def next[T <: Data](value: T): T = RegEnable(value, true.B)
  private val isFirst                      = io.distance.valid
  private val input                        = io.distance.bits
  private val sum                          =
    RegEnable(Rounding.floor(input.tEntry.natural, -numbers.gridFraction) +& input.t.integer.asUInt, isFirst)
  private val scales = next(RegEnable(input.scale, isFirst))

  private val dividend = next(Normalise(sum, mantissa))
  private val divider  = Module(
    new PipelinedDivider(mantissa, digits, lanes = 1, bitsPerStage = WorldDistance.bitsPerStage)
  ).io
  divider.loads.foreach(_ := true.B)
  divider.numerators  := VecInit(dividend.mantissa)
  divider.denominator := scales.length.mantissa

  // quotient · 2^-(digits - dividend's exponent + length's - scale): below a step of the largest t, it is saturated
  private val least =
    digits - numbers.shearFraction + ObjectInstance.directionDrop(numbers) // of that, without the variables
  private val raised = (grid - digits).max(0) + 1
  private val amount =
    (scales.length.exponent.zext -& dividend.exponent.zext) -& scales.shift.zext +& (least + raised).S
  private val right    = Seq.iterate(amount, WorldDistance.stages(numbers) + 1)(next(_)).last
  private val quotient = divider.quotients.head
  private val shifted = Rounding.saturate(Cat(quotient, 0.U(raised.W)) >> right.asUInt(right.getWidth - 2, 0), grid - 1)
  private val most    = ((BigInt(1) << (grid - 1)) - 1).U((grid - 1).W)
  private val t       = next(Mux(right < 0.S && quotient.orR, most, shifted))
  io.t.valid := Seq.iterate(isFirst, WorldDistance.latency(numbers) + 1)(RegNext(_, false.B)).last
  io.t.bits  := Fixed(new RayFormats(numbers).grid, t.zext)
}

private[colonnade] object WorldDistance {
  private val bitsPerStage = 3

  private def stages(numbers: NumberFormats): Int = PipelinedDivider.stages(numbers.distanceDigits, bitsPerStage)

  def latency(numbers: NumberFormats): Int = stages(numbers) + 3
}
