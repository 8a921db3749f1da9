package colonnade.ray

import chisel3._
import chisel3.util.{Cat, Mux1H, RegEnable}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.numbers.{Normalise, PipelinedDivider, Rounding}

/** The stages of [[RaySetupPipeline]] by number, named after what their registers hold. Stage 0 holds the
  * magnitudes of a direction, stage 1 the mantissas.
  */
final class SetupStages(numbers: NumberFormats) {
  val mantissas: Int = 1

  /** Both reciprocals; the quotients of both shear factors. */
  val reciprocals:    Int = mantissas + PipelinedDivider.stages(numbers.reciprocalDigits)
  val shearQuotients: Int = mantissas + PipelinedDivider.stages(numbers.shearDigits)

  /** Distances to the box, when the reciprocals come. Three stages compute them, from the ray that is fetched there. */
  val distances:   Int = reciprocals
  val planes:      Int = distances - 1
  val unitOrigins: Int = distances - 2
  val fetchedRay:  Int = distances - 3

  /** From distances along an axis to distances along the ray. */
  val products:  Int = distances + 1
  val crossings: Int = distances + 2
  val limits:    Int = distances + 3
  val entry:     Int = distances + 4
  val enters:    Int = distances + 5

  /** Shear factors, from quotients and exponents; the advance, when both factors and the entry are there. */
  val shears:      Int = shearQuotients.max(unitOrigins) + 1
  val operands:    Int = entry.max(shears)
  val advances:    Int = operands + 1
  val preparedRay: Int = operands + 2
  val count:       Int = preparedRay + 1
}

/** Registers of a pipeline; stage i loads in a cycle with `loads(i)`. */
final class StageRegisters(loads: Vec[Bool]) {

  /** A value as a register of a stage; a register of stage `from` as one of stage `to`. */
  def load[T <: Data](value: T, stage: Int): T          = RegEnable(value, loads(stage))
  def hold[T <: Data](value: T, from:  Int, to: Int): T = (from + 1 to to).foldLeft(value)(load(_, _))
}

final class DirectionStagesIO(config: PathConfig) extends Bundle {
  val loads   = Input(Vec(2, Bool()))
  val request = Input(new RayRequest(config))

  /** The ray in stage 0, in its own frame; its mantissas in stage 1. */
  val ray       = Output(new PermutedRay(config))
  val mantissas = Output(new DirectionMantissas(config.numbers))
}

/** What a [[DirectionNormaliser]] does, a ray a cycle: stage 0 has the magnitudes; from there, three normalisers and
  * three comparators in parallel lead to stage 1. Source: docs/numbers.md, sections 2.1 and 2.2.
  */
final class DirectionStages(config: PathConfig) extends Module {
  private val numbers = config.numbers

  val io = IO(new DirectionStagesIO(config))

  private val request    = io.request
  private val context    = RegEnable(request.context, io.loads(0))
  private val isShadow   = RegEnable(request.isShadow, io.loads(0))
  private val origin     = request.origin.axes.map(RegEnable(_, io.loads(0)))
  private val magnitudes = request.dir.axes.map(component => RegEnable(Normalise.magnitude(component), io.loads(0)))
  private val negative   = request.dir.axes.map(component => RegEnable(component < 0.S, io.loads(0)))

  // Ties go to the lowest axis
  private val isZ = magnitudes(2) > magnitudes(1) && magnitudes(2) > magnitudes(0)
  private val isY = magnitudes(1) > magnitudes(0) && !isZ

  /** Components in the ray's own frame. */
  private def permuted[T <: Data](axes: Seq[T]): Seq[T] = Seq(1, 2, 0).map { shift =>
    def after(axis: Int) = axes((axis + shift) % 3)
    Mux1H(Seq((!isY && !isZ) -> after(0), isY -> after(1), isZ -> after(2)))
  }

  private val normalised                   = permuted(magnitudes.map(Normalise(_, numbers.mantissaBits)))
  private val Seq(minor0, minor1, largest) = normalised
  private val info                         = io.ray.info
  info.context          := context
  info.isShadow         := isShadow
  info.orientation.axis := Cat(isZ, isY)
  info.orientation.negative.zip(permuted(negative)).foreach { case (to, from) => to := from }
  info.exponent.zip(normalised).foreach { case (to, from) => to := largest.exponent - from.exponent }
  info.isZero.zip(normalised).foreach { case (to, from) => to := from.exponent === 0.U }
  io.ray.origin.zip(permuted(origin)).foreach { case (to, from) => to := from }

  private val length    = Rounding.saturate(permuted(magnitudes).last, numbers.sceneBits + 1)
  private val unlimited = ((BigInt(1) << (numbers.sceneBits + 1)) - 1).U
  io.ray.tMax := Mux(isShadow, length, unlimited)
  for (limits <- io.ray.limits; requested <- request.limits) {
    limits      := RegEnable(requested, io.loads(0))
    io.ray.tMax := limits.tMax
  }

  for (visit <- request.visit) {
    val held = RegEnable(visit, io.loads(0))
    info.ofVisit(held)
    when(held.valid) { io.ray.tMax := held.bits.tMax }
  }

  io.mantissas.minor.zip(Seq(minor0, minor1)).foreach { case (to, from) =>
    to := RegEnable(from.mantissa, io.loads(1))
  }
  io.mantissas.dominant := RegEnable(largest.mantissa, io.loads(1))
}
