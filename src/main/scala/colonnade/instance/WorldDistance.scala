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
  private val stages   = PipelinedDivider.stages(digits)

  val io = IO(new WorldDistanceIO(config))

  // Stages: sum, mantissa, division, shift
  private val holds = Seq.iterate(io.distance.valid, WorldDistance.latency(numbers) + 1)(RegNext(_, false.B))

  /** A register of a stage. */
  private def load[T <: Data](value: T, stage: Int): T = RegEnable(value, holds(stage - 1))

  private val input  = io.distance.bits
  private val sum    = load(Rounding.floor(input.tEntry.natural, -numbers.gridFraction) +& input.t.integer.asUInt, 1)
  private val scales = load(load(input.scale, 1), 2)

  private val dividend = load(Normalise(sum, mantissa), 2)
  private val divider  = Module(new PipelinedDivider(mantissa, digits, lanes = 1)).io
  divider.loads       := VecInit(holds.slice(2, 2 + stages))
  divider.numerators  := VecInit(dividend.mantissa)
  divider.denominator := scales.length.mantissa

  // quotient · 2^-(digits - dividend's exponent + length's - scale): below a step of the largest t, it is saturated
  private val least =
    digits - numbers.shearFraction + ObjectInstance.directionDrop(numbers) // of that, without the variables
  private val raised = (grid - digits).max(0) + 1
  private val amount =
    (scales.length.exponent.zext -& dividend.exponent.zext) -& scales.shift.zext +& (least + raised).S
  private val right    = (2 until 2 + stages).foldLeft(amount)((value, stage) => load(value, stage + 1))
  private val quotient = divider.quotients.head
  private val shifted = Rounding.saturate(Cat(quotient, 0.U(raised.W)) >> right.asUInt(right.getWidth - 2, 0), grid - 1)
  private val most    = ((BigInt(1) << (grid - 1)) - 1).U((grid - 1).W)
  private val t       = load(Mux(right < 0.S && quotient.orR, most, shifted), WorldDistance.latency(numbers))
  io.t.valid := holds.last
  io.t.bits  := Fixed(new RayFormats(numbers).grid, t.zext)
}

private[colonnade] object WorldDistance {
  def latency(numbers: NumberFormats): Int = PipelinedDivider.stages(numbers.distanceDigits) + 3
}
