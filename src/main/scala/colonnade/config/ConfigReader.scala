package colonnade.config

/** One object of a configuration's JSON, whose keys must be exactly the known ones.
  *
  * @param path of this object, ending with a dot unless it is empty
  */
private[config] final class ConfigReader(path: String, json: ujson.Value, known: Seq[String]) {
  import ConfigReader._

  private val fields: Map[String, ujson.Value] = json match {
    case ujson.Obj(values) => values.toMap
    case other => throw wrong(path.stripSuffix("."), other, s"an object with the keys ${known.mkString(", ")}")
  }

  fields.keys
    .find(!known.contains(_))
    .foreach { key =>
      val advice = renamed.get(key).fold(s"known here: ${known.mkString(", ")}")(name => s"it is $name now")
      throw new ConfigError(s"unknown key $path$key; $advice")
    }

  def value(key: String): ujson.Value =
    fields.getOrElse(key, throw new ConfigError(s"$path$key is missing; give it a value"))

  def section(key: String, known: String*): ConfigReader = new ConfigReader(s"$path$key.", value(key), known)

  def optionalSection(key: String, known: String*): Option[ConfigReader] =
    if (value(key).isNull) None else Some(section(key, known: _*))

  def int(key: String): Int = value(key) match {
    case ujson.Num(number) if number.isValidInt => number.toInt
    case other                                  => throw wrong(path + key, other, "a whole number")
  }

  def optionalInt(key: String): Option[Int] = if (value(key).isNull) None else Some(int(key))

  def boolean(key: String): Boolean = value(key) match {
    case ujson.Bool(flag) => flag
    case other            => throw wrong(path + key, other, "true or false")
  }

  /** One of the known values, by its name. */
  def choice[T](key: String, known: Seq[T])(name: T => String): T =
    known
      .find(candidate => value(key) == ujson.Str(name(candidate)))
      .getOrElse(throw wrong(path + key, value(key), s"one of ${known.map(name).mkString(", ")}"))
}

private[config] object ConfigReader {

  /** Keys of earlier versions, by their present names. */
  private val renamed = Map("shellPlanes" -> "boundingPlanes", "shared" -> "columnsPerCopy")

  def wrong(where: String, found: ujson.Value, rule: String): ConfigError = {
    val subject = if (where.isEmpty) "the configuration" else where
    new ConfigError(s"$subject is ${shortened(found.render())}; it must be $rule")
  }

  private def shortened(text: String): String = if (text.length <= 60) text else text.take(57) + "..."
}
