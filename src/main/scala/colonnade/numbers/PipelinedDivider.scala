package colonnade.numbers

import chisel3._
import chisel3.util.{Cat, RegEnable}

final class PipelinedDividerIO(mantissaBits: Int, digits: Int, lanes: Int, hasRest: Boolean, bitsPerStage: Int)
    extends Bundle {
  val loads = Input(Vec(PipelinedDivider.stages(digits, bitsPerStage), Bool())) // stage i loads from the stage before

  /** The numerator's top bit is set, or it is zero; the denominator's top bit is set. */
  val numerators  = Input(Vec(lanes, UInt(mantissaBits.W)))
  val denominator = Input(UInt(mantissaBits.W))

  val quotients = Output(Vec(lanes, UInt((digits + 1).W))) // ⌊numerator · 2^digits / denominator⌋

  /** A quotient is inexact. */
  val rests = Option.when(hasRest)(Output(Vec(lanes, Bool())))
}

/** Divides mantissas as [[Divider]] does, a division a cycle in each lane. The lanes share the denominator.
  *
  * Restoring recurrence in radix 2, two quotient bits a stage: two subtractors in series are a third smaller than the
  * three parallel ones of radix 4, and fit the cycle. Latency: ⌈(digits + 1) / bitsPerStage⌉ loads. A stage that does not
  * load holds its values.
  *
  * @param digits fraction bits of the quotient
  * @param lanes  numerators that are divided by the same denominator
  * @param hasRest it tells inexact quotients
  * @param bitsPerStage subtractors in series
  */
final class PipelinedDivider(
    mantissaBits: Int,
    digits:       Int,
    lanes:        Int,
    hasRest:      Boolean = false,
    bitsPerStage: Int = PipelinedDivider.bitsPerStage
) extends Module {
  import PipelinedDivider.stages
  require(mantissaBits >= 2, s"a divider of $mantissaBits-bit mantissas; they must have at least 2 bits")
  require(digits >= 0, s"a divider for $digits digits; it must be for at least 0")

  val io = IO(new PipelinedDividerIO(mantissaBits, digits, lanes, hasRest, bitsPerStage))

  /** A partial division: the remainder is less than twice the denominator. */
  private case class Partial(remainder: UInt, quotient: Option[UInt])

  private def step(from: Partial, denominator: UInt): Partial = {
    val (fits, rest) = DigitRecurrence.step(from.remainder, denominator, mantissaBits)
    Partial(Cat(rest, false.B), Some(from.quotient.fold(fits.asUInt)(Cat(_, fits))))
  }

  private val begin    = (io.numerators.map(n => Partial(Cat(false.B, n), None)).toSeq, io.denominator)
  private val (end, _) =
    (0 until stages(digits, bitsPerStage)).foldLeft(begin) { case ((partials, denominator), stage) =>
      val bits = bitsPerStage.min(digits + 1 - bitsPerStage * stage)
      val next = partials.map { partial =>
        val stepped = (0 until bits).foldLeft(partial)((each, _) => step(each, denominator))
        Partial(RegEnable(stepped.remainder, io.loads(stage)), stepped.quotient.map(RegEnable(_, io.loads(stage))))
      }
      (next, RegEnable(denominator, io.loads(stage)))
    }
  io.quotients.zip(end).foreach { case (to, partial) => to := partial.quotient.get }
  for (rests <- io.rests; (to, partial) <- rests.zip(end)) to := partial.remainder.orR
}

object PipelinedDivider {
  private val bitsPerStage = 2

  /** Latency of a division. */
  def stages(digits: Int, bitsPerStage: Int = bitsPerStage): Int = (digits + bitsPerStage) / bitsPerStage
}
