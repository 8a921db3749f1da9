package colonnade.ray

import chisel3._
import chisel3.util.Cat
import colonnade.config.PathConfig
import colonnade.numbers.Divider

/** Prepares rays for traversal, one after the other and in order, with up to three rays in flight: docs/traversal.md.
  *
  * With quotients of 31 and 19 bits, the latency is about 30 cycles and the throughput at least one ray every 16 cycles; it
  * is one every 27 cycles at the widest formats with extra slices. The quotients of a component that is 0 are computed,
  * then replaced. A direction of 0 gives a ray that does not enter the box. Source: docs/numbers.md, section 2.
  */
final class SequentialRaySetup(config: PathConfig) extends RaySetup(config) {
  private val numbers = config.numbers

  private val normaliser = Module(new DirectionNormaliser(config))
  private val shears = Seq.fill(2)(Module(new Divider(numbers.mantissaBits, numbers.shearDigits, digitsPerCycle = 2)))
  private val reciprocals = Seq.fill(2)(Module(new Divider(numbers.mantissaBits, numbers.reciprocalDigits)))
  private val entry       = Module(new RayEntry(config))
  private val dividers    = shears ++ reciprocals

  normaliser.io.request :<>= io.request
  entry.io.ray :<>= normaliser.io.ray
  entry.io.bounds := io.bounds
  io.ray :<>= entry.io.output
  io.busy := entry.io.busy

  // All dividers start together, and their quotients are taken together
  private val mantissas = normaliser.io.mantissas
  private val areFree   = dividers.map(_.io.division.ready).reduce(_ && _)
  mantissas.ready := areFree
  dividers.foreach(_.io.division.valid := mantissas.valid && areFree)
  shears.zip(mantissas.bits.minor).foreach { case (divider, minor) =>
    divider.io.division.bits.numerator   := minor
    divider.io.division.bits.denominator := normalised(mantissas.bits.dominant)
  }
  reciprocals.zip(mantissas.bits.minor).foreach { case (divider, minor) =>
    divider.io.division.bits.numerator   := mantissas.bits.dominant
    divider.io.division.bits.denominator := normalised(minor)
  }

  private val areDone = dividers.map(_.io.quotient.valid).reduce(_ && _)
  entry.io.quotients.valid := areDone
  dividers.foreach(_.io.quotient.ready := areDone && entry.io.quotients.ready)
  entry.io.quotients.bits.shear.zip(shears).foreach { case (to, divider) => to := divider.io.quotient.bits }
  entry.io.quotients.bits.reciprocal.zip(reciprocals).foreach { case (to, divider) => to := divider.io.quotient.bits }

  /** Sets the top bit, also of a component that is 0, whose quotient is not used. */
  private def normalised(mantissa: UInt): UInt = Cat(true.B, mantissa(numbers.mantissaBits - 2, 0))
}
