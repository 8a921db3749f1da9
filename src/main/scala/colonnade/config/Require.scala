package colonnade.config

/** Checks of configuration values; a failure names the field, the value and the rule. */
private[config] object Require {

  def within(field: String, value: Int, low: Int, high: Int): Unit =
    if (value < low || value > high) throw new ConfigError(s"$field is $value; it must be from $low to $high")

  def atLeast(field: String, value: Int, low: Int): Unit =
    if (value < low) throw new ConfigError(s"$field is $value; it must be at least $low")

  def oneOf(field: String, value: Int, allowed: Seq[Int]): Unit =
    if (!allowed.contains(value))
      throw new ConfigError(s"$field is $value; it must be one of ${allowed.mkString(", ")}")
}

/** A configuration that cannot be built; the message is one line for the user. */
final class ConfigError(message: String) extends IllegalArgumentException(message)
