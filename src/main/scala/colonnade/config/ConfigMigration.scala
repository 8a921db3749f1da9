package colonnade.config

/** Brings the JSON of a configuration of an older version to the present one. */
private[config] object ConfigMigration {

  /** A change of a configuration's JSON. */
  private type Change = ujson.Obj => Unit

  /** What each version changes in configurations of the one before; version 2 comes first. */
  private val changes: Seq[Seq[Change]] = Seq(
    Seq(
      renamed("physicalAttributeMemory", "shellPlanes", "boundingPlanes"),
      replaced("physicalAttributeMemory", "shared") { shared =>
        Seq("columnsPerCopy" -> ujson.Num(if (shared == ujson.True) ArrayConfig.maxColumns else 1))
      },
      replaced("units", "directView")(_ => Nil),
      replaced("units", "pipelined") { pipelined =>
        val (ray, shade) = if (pipelined == ujson.True) (1, 3) else (32, 128)
        Seq("rayInterval" -> ujson.Num(ray), "shadeInterval" -> ujson.Num(shade))
      },
      renamed("units", "shortPaths", "extraSlices"),
      zeroIsDefault("units", "marches"),
      zeroIsDefault("units", "pathContexts")
    ),
    // These change the tests of a frame, not its picture
    Seq(
      replaced("geometry", "boxBits") { bits =>
        Seq("boxBits" -> bits.numOpt.fold(bits)(value => ujson.Num(value.min(7))))
      },
      replaced("geometry", "arity")(_ => Nil),
      replaced("geometry", "trianglesPerRecord")(_ => Nil)
    ),
    Seq(raysAreQueries)
  )

  /** The present version; a file without one has version 1. */
  val version: Int = changes.size + 1

  /** The JSON in the present version, without its key `version`. */
  def apply(json: ujson.Value): ujson.Value = json match {
    case ujson.Obj(fields) =>
      val of = fields.getOrElse("version", ujson.Num(1)) match {
        case ujson.Num(number) if number.isValidInt && number >= 1 => number.toInt
        case other                                                 =>
          throw new ConfigError(s"version is ${other.render()}; it must be a whole number from 1 to $version")
      }
      if (of > version)
        throw new ConfigError(s"the configuration has version $of, this generator reads $version at most: update it")
      val migrated = ujson.Obj.from(ujson.copy(json).obj.filter(_._1 != "version"))
      changes.drop(of - 1).flatten.foreach(_(migrated))
      migrated
    case other => other
  }

  /** Replaces a key of a section, if it has one, by others. */
  private def replaced(section: String, key: String)(by: ujson.Value => Seq[(String, ujson.Value)]): Change = config =>
    for {
      fields <- sectionOf(config, section)
      value  <- fields.remove(key)
    } fields ++= by(value)

  private def renamed(section: String, key: String, name: String): Change =
    replaced(section, key)(value => Seq(name -> value))

  /** `frame.rays` has a section of its own, and contexts of its own. */
  private def raysAreQueries: Change = config =>
    for {
      frame <- sectionOf(config, "frame")
      isSet <- frame.get("rays").flatMap(_.boolOpt)
    } {
      frame.remove("rays")
      if (isSet) {
        val contexts = sectionOf(config, "units").flatMap(_.remove("pathContexts"))
        config("queries") = ujson.Obj.from(contexts.map("contexts" -> _))
      }
    }

  private def sectionOf(config: ujson.Obj, name: String) = config.value.get(name).flatMap(_.objOpt)

  private def zeroIsDefault(section: String, key: String): Change =
    replaced(section, key)(value => Seq(key -> value).filterNot(_._2 == ujson.Num(0)))
}
