package colonnade.config

/** The keys of a configuration's JSON and their types, read off an example of the case classes. */
private[config] object ConfigSchema {

  /** Checks JSON against an example, and adds the keys that it lacks.
    *
    * @param example  with every optional part, which says how its JSON looks
    * @param defaults the values of keys that the JSON lacks
    * @param path     of the value, for messages; empty for the whole configuration
    */
  def completed(json: ujson.Value, example: Any, defaults: Any, path: String = ""): ujson.Value =
    (example, json) match {
      case (_: Boolean, _: ujson.Bool)                                           => json
      case (_: Int, ujson.Num(number)) if number.isValidInt                      => json
      case (Some(_), ujson.Null)                                                 => json
      case (_: MapEncoding, ujson.Str(name)) if MapEncoding.named(name).nonEmpty => json
      case (Some(part), _) => completed(json, part, defaults match { case Some(part) => part; case _ => part }, path)
      case (_: PrecisionConfig, ujson.Str(PrecisionConfig(bits))) => written(bits)
      case (section: Product, ujson.Obj(fields))                  =>
        val known = namesOf(section)
        fields.keys.find(!known.contains(_)).foreach { key =>
          throw new ConfigError(s"unknown key ${join(path, key)}; known here: ${known.mkString(", ")}")
        }
        val parts = section.productIterator.zip(defaults.asInstanceOf[Product].productIterator)
        ujson.Obj.from(known.zip(parts).map { case (key, (part, default)) =>
          key -> fields.get(key).fold(written(default))(completed(_, part, default, join(path, key)))
        })
      case _ => throw wrong(path, json, ruleOf(example))
    }

  /** The JSON of a configuration or of a part of it. */
  def written(part: Any): ujson.Value = part match {
    case flag: Boolean         => ujson.Bool(flag)
    case number: Int           => ujson.Num(number)
    case None                  => ujson.Null
    case encoding: MapEncoding => ujson.Str(encoding.name)
    case Some(part)            => written(part)
    case section: Product      => ujson.Obj.from(namesOf(section).zip(section.productIterator.map(written)))
    case other                 => throw new IllegalArgumentException(s"$other is no part of a configuration")
  }

  private def wrong(path: String, found: ujson.Value, rule: String): ConfigError = {
    val text = found.render()
    val part = if (path.isEmpty) "the configuration" else path
    new ConfigError(s"$part is ${if (text.length <= 60) text else text.take(57) + "..."}; it must be $rule")
  }

  private def ruleOf(example: Any): String = example match {
    case _: Boolean               => "true or false"
    case _: Int                   => "a whole number"
    case _: MapEncoding           => s"one of ${MapEncoding.all.map(_.name).mkString(", ")}"
    case Some(example)            => ruleOf(example)
    case section: PrecisionConfig => s"like $section, or an object with the keys ${namesOf(section).mkString(", ")}"
    case section: Product         => s"an object with the keys ${namesOf(section).mkString(", ")}"
  }

  private def namesOf(section: Product): Seq[String] = section.productElementNames.toSeq

  private def join(path: String, key: String): String = if (path.isEmpty) key else s"$path.$key"
}
