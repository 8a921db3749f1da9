package colonnade.config

import scala.collection.mutable
import scala.util.{DynamicVariable, Try}

/** Checks of configuration values; a failure names the field, the value and the rule. */
private[colonnade] object Require {

  /** Field and rule of what has failed within [[all]]; none outside, where a failure is an error at once. */
  private val failures = new DynamicVariable[Option[mutable.ListBuffer[(String, String)]]](None)

  /** What `build` makes. All that it requires and does not find is one error; what it throws after a failure is not
    * told.
    */
  def all[T](build: => T): T =
    if (failures.value.nonEmpty) build
    else {
      val failed = mutable.ListBuffer.empty[(String, String)]
      val built  = Try(failures.withValue(Some(failed))(build))
      if (failed.nonEmpty) throw new ConfigError(text(failed.toSeq))
      built.get
    }

  /** What `build` makes, whatever it requires. */
  def unchecked[T](build: => T): T = failures.withValue(Some(mutable.ListBuffer.empty))(build)

  /** Checks what is only of interest if nothing has failed. */
  def ifSound(checks: => Unit): Unit = if (failures.value.forall(_.isEmpty)) checks

  def apply(field: String, holds: Boolean, rule: String): Unit = if (!holds) failures.value match {
    case Some(failed) => failed += field -> rule
    case None         => throw new ConfigError(text(Seq(field -> rule)))
  }

  /** @param orElse a legal value outside the range, for the message */
  def within(field: String, value: Int, low: Int, high: Int, orElse: String = ""): Unit =
    Require(field, value >= low && value <= high, s"is $value; it must be ${orElse}from $low to $high")

  def oneOf(field: String, value: Int, allowed: Seq[Int]): Unit =
    Require(field, allowed.contains(value), s"is $value; it must be one of ${allowed.mkString(", ")}")

  /** What one field needs stands together. */
  private def text(failed: Seq[(String, String)]): String =
    failed
      .map(_._1)
      .distinct
      .map { field =>
        val rules = failed.collect { case (`field`, rule) => rule }
        s"$field ${(rules.head +: rules.tail.map(_.stripPrefix("needs "))).mkString(", ")}"
      }
      .mkString(". ")
}

/** A configuration that cannot be built; the message is one line for the user. */
final class ConfigError(message: String) extends IllegalArgumentException(message)
