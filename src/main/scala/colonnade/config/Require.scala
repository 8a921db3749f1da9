package colonnade.config

/** Checks of configuration values; a failure names the field, the value and the rule. */
private[config] object Require {

  def apply(field: String, holds: Boolean, rule: String): Unit =
    if (!holds) throw new ConfigError(s"$field $rule")

  /** @param orElse a legal value outside the range, for the message */
  def within(field: String, value: Int, low: Int, high: Int, orElse: String = ""): Unit =
    if (value < low || value > high)
      throw new ConfigError(s"$field is $value; it must be ${orElse}from $low to $high")

  def oneOf(field: String, value: Int, allowed: Seq[Int]): Unit =
    if (!allowed.contains(value))
      throw new ConfigError(s"$field is $value; it must be one of ${allowed.mkString(", ")}")
}

/** A configuration that cannot be built; the message is one line for the user. */
final class ConfigError(message: String) extends IllegalArgumentException(message)
