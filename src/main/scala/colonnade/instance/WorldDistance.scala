package colonnade.instance

import chisel3._
import chisel3.util.{Cat, Decoupled, RegEnable}
import colonnade.config.PathConfig
import colonnade.formats.ObjectInstance
import colonnade.numbers.{Divider, Fixed, Normalise, Rounding}
import colonnade.ray.RayFormats

/** A hit's distance along an object's ray, which enters the cube at `tEntry` and hits at `t`. */
final class ObjectDistance(config: PathConfig) extends Bundle {
  private val formats = new RayFormats(config.numbers)

  val tEntry = new Fixed(formats.entry)
  val t      = new Fixed(formats.grid)
  val scale  = new ObjectScale(config.numbers)
}

final class WorldDistanceIO(config: PathConfig) extends Bundle {
  val distance = Flipped(Decoupled(new ObjectDistance(config)))
  val t        = Decoupled(new Fixed(new RayFormats(config.numbers).grid))
}

/** Finds distances along the ray of the world by a division each, one after the other. Source: docs/numbers.md, section 10. */
final class WorldDistance(config: PathConfig) extends Module {
  private val numbers = config.numbers
  private val grid    = numbers.gridBits
  private val digits  = numbers.distanceDigits

  val io = IO(new WorldDistanceIO(config))

  private val input = RegEnable(io.distance.bits, io.distance.fire)
  private val state = RegInit(0.U(3.W)) // idle; sum, mantissa, division, shift, offer
  io.distance.ready := state === 0.U

  private val sum =
    RegEnable(Rounding.floor(input.tEntry.natural, -numbers.gridFraction) +& input.t.integer.asUInt, state === 1.U)
  private val dividend = RegEnable(Normalise(sum, numbers.mantissaBits), state === 2.U)
  private val divider  = Module(new Divider(numbers.mantissaBits, digits)).io
  private val isIssued = RegInit(false.B)
  divider.division.valid            := state === 3.U && !isIssued
  divider.division.bits.numerator   := dividend.mantissa
  divider.division.bits.denominator := input.scale.length.mantissa
  divider.quotient.ready            := state === 3.U

  // quotient · 2^-(digits - dividend's exponent + length's - scale): below a step of the largest t, it is saturated
  private val least =
    digits - numbers.shearFraction + ObjectInstance.directionDrop(numbers) // of that, without the variables
  private val raised = (grid - digits).max(0) + 1
  private val amount = (input.scale.length.exponent.zext -& dividend.exponent.zext) -& input.scale.shift.zext +&
    (least + raised).S
  private val right    = RegEnable(amount, state === 3.U)
  private val quotient = RegEnable(divider.quotient.bits, divider.quotient.fire)
  private val wide     = Cat(quotient, 0.U(raised.W))
  private val shifted  = Rounding.saturate(wide >> right.asUInt(right.getWidth - 2, 0), grid - 1)
  private val most     = ((BigInt(1) << (grid - 1)) - 1).U((grid - 1).W)
  private val t        = RegEnable(Mux(right < 0.S && quotient.orR, most, shifted), state === 4.U)

  when(io.distance.fire || state === 1.U || state === 2.U || state === 4.U) { state := state + 1.U }
  when(divider.division.fire) { isIssued := true.B }
  when(divider.quotient.fire) {
    state    := 4.U
    isIssued := false.B
  }
  when(io.t.fire) { state := 0.U }
  io.t.valid := state === 5.U
  io.t.bits  := Fixed(new RayFormats(numbers).grid, t.zext)
}
