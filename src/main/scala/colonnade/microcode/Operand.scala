package colonnade.microcode

import chisel3._
import chisel3.util.Mux1H

import scala.collection.mutable

/** An operand of a datapath unit, for which different steps choose different values. Each value has one select
  * register, shared by all steps that choose it.
  */
final class Operand(program: Microprogram[_], width: Int) {
  private val choices = mutable.LinkedHashMap.empty[SInt, Set[Int]]

  /** In a step: the operand is this value. A step chooses at most one. */
  def choose(value: SInt): Unit = {
    require(
      choices.forall { case (other, steps) => (other eq value) || !steps(program.index) },
      s"two operands in step ${program.index}"
    )
    choices(value) = choices.getOrElse(value, Set.empty) + program.index
  }

  /** The current step chooses a value. */
  lazy val isChosen: Bool = program.isOneOf(choices.values.flatten.toSet)

  /** The value that the current step chooses; 0 if it chooses none. */
  lazy val value: SInt = Mux1H(choices.toSeq.map { case (value, steps) => program.isOneOf(steps) -> fit(value) })

  private def fit(value: SInt): SInt =
    if (value.getWidth > width) value.asUInt(width - 1, 0).asSInt else value.pad(width)
}
