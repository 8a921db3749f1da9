package colonnade.microcode

import scala.collection.mutable

/** Parts of consecutive steps, see [[Microprogram.overlap]]. */
final class Overlap[L <: Label] {
  private val parts  = mutable.ArrayBuffer.empty[(Int, () => Unit)]
  private val placed = mutable.ArrayBuffer.empty[(Int, L)]

  /** Adds a part to the step of this cycle. */
  def apply(cycle: Int)(part: => Unit): Unit = parts += cycle -> (() => part)

  /** Labels the step of this cycle. */
  def label(cycle: Int, label: L): Unit = placed += cycle -> label

  private[microcode] def labels: Seq[(Int, L)] = placed.toSeq

  /** The parts of each cycle up to the last. */
  private[microcode] def byCycle: Seq[Seq[() => Unit]] =
    (0 to parts.map(_._1).max).map(cycle => parts.toSeq.collect { case (`cycle`, part) => part })
}
