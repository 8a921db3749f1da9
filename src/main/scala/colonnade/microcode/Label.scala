package colonnade.microcode

import chisel3._

/** A step that a program can jump to. A program's labels are the case objects of one sealed trait, so a jump into another
  * program does not compile.
  */
trait Label {

  /** A jump to this step.
    *
    * @param reason the condition in words, for the program's graph
    */
  def when(condition: Bool, reason: String): Exit[this.type] = Exit(Some(this), Some(condition), reason)

  /** A jump to this step that is always taken. */
  def otherwise: Exit[this.type] = Exit(Some(this), None, "")
}

/** One way out of a step.
  *
  * @param target    the next step; none repeats the step that it leaves
  * @param condition none always holds
  * @param reason    the condition in words; of a repetition, what it waits for
  */
final case class Exit[+L <: Label](target: Option[L], condition: Option[Bool], reason: String)

/** A step that waits. */
object Repeat {

  /** Repeats the step until the condition holds.
    *
    * @param reason what the step waits for
    */
  def until(condition: Bool, reason: String): Exit[Nothing] = Exit(None, Some(!condition), reason)
}
