package colonnade.ray

import chisel3._
import chisel3.util.RegEnable
import colonnade.config.NumberFormats
import colonnade.numbers.PipelinedDivider

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
