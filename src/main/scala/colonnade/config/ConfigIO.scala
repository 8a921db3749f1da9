package colonnade.config

import java.io.IOException
import java.nio.charset.StandardCharsets.UTF_8
import java.nio.file.{Files, InvalidPathException, Paths}

/** Configurations as JSON, for which [[ColonnadeConfig]] has the names, types and defaults of all keys; `precision` may
  * also be written in the paper's notation, as in `"32b32s64d"`. No other key is accepted. Files of older versions are
  * migrated, see `ConfigMigration`. All failures are [[ConfigError]]s.
  */
object ConfigIO {

  /** The names of the presets: the files of `configs`. */
  lazy val presets: Seq[String] = resource("names").linesIterator.toSeq
  private val maxBytes = 1 << 20 // maximum size of a configuration file

  /** The configuration of a preset's name, of a file, or of a precision such as `16b16s32d`: `small` with that
    * precision and with triangle tests as wide as `precision.mac`.
    *
    * @param overrides `path.to.key=value`, applied in order; a value is JSON, or else a string without quotes
    */
  def load(name: String, overrides: Seq[String] = Nil): ColonnadeConfig = {
    val (base, settings) = name match {
      case PrecisionConfig(bits) => ("small", Seq(s"precision=$bits", "geometry.triangleBits=null"))
      case other                 => (other, Nil)
    }
    val text = if (presets.contains(base)) resource(s"$base.json") else fileText(base)
    built((settings ++ overrides).foldLeft(completed(ConfigMigration(parse(text, base))))(withOverride))
  }

  def read(json: ujson.Value): ColonnadeConfig = built(completed(ConfigMigration(json)))

  /** The JSON that [[read]] takes, with every key and with `precision` spelled out. */
  def write(config: ColonnadeConfig): ujson.Obj =
    ujson.Obj.from(("version" -> ujson.Num(ConfigMigration.version)) +: ConfigSchema.written(config).obj.toSeq)

  private def completed(json: ujson.Value): ujson.Value =
    ConfigSchema.completed(json, example, ColonnadeConfig())

  /** With every optional part, although no device has all of them. */
  private lazy val example =
    Require.unchecked(ColonnadeConfig.complete.copy(queries = Some(QueriesConfig())))

  private def built(json: ujson.Value): ColonnadeConfig = Require.all(ConfigPickler.read[ColonnadeConfig](json))

  private def withOverride(json: ujson.Value, setting: String): ujson.Value = {
    val (path, value) = setting.split("=", 2) match {
      case Array(path, text) if path.nonEmpty => (path.split("\\.", -1).toList, valueOf(text))
      case _                                  =>
        throw new ConfigError(s"the setting '$setting' is not of the form path.to.key=value, as in array.rows=4")
    }

    def replaced(at: ujson.Value, rest: List[String]): ujson.Value = (at, rest) match {
      case (_, Nil)                                                                 => value
      case (ujson.Obj(fields), key :: keys) if keys.isEmpty || fields.contains(key) =>
        ujson.Obj.from(fields.toSeq :+ key -> fields.get(key).fold(value)(replaced(_, keys)))
      case (ujson.Null, _) =>
        throw new ConfigError(s"the setting '$setting' changes a part of what is null; set the whole section first")
      case _ => throw new ConfigError(s"unknown key ${path.mkString(".")} in the setting '$setting'")
    }
    completed(replaced(json, path))
  }

  private def valueOf(text: String): ujson.Value =
    try StrictJson.read(text, s"the value '${text.take(40)}'")
    catch { case _: ujson.ParsingFailedException => ujson.Str(text) }

  private def parse(text: String, source: String): ujson.Value =
    try StrictJson.read(text, source)
    catch {
      case failure: ujson.ParsingFailedException =>
        val reason = Option(failure.getMessage).getOrElse("").linesIterator.nextOption().getOrElse("")
        throw new ConfigError(s"$source is not JSON: $reason")
    }

  private def fileText(name: String): String = {
    def missing(reason: String) =
      new ConfigError(s"$reason; name one of ${presets.mkString(", ")}, a JSON file, or a precision like 32b32s64d")
    val path =
      try Paths.get(name)
      catch { case _: InvalidPathException => throw missing(s"'$name' is no configuration") }
    if (!Files.isRegularFile(path)) throw missing(s"there is no configuration '$name'")
    if (Files.size(path) > maxBytes)
      throw new ConfigError(s"$name is too large: a configuration may have $maxBytes bytes")
    try Files.readString(path, UTF_8)
    catch { case failure: IOException => throw new ConfigError(s"cannot read $name as text: ${failure.getMessage}") }
  }

  /** A file that the build puts beside the classes. */
  private def resource(name: String): String = {
    val resource = s"/colonnade/configs/$name"
    val stream   = Option(getClass.getResourceAsStream(resource))
      .getOrElse(throw new IllegalStateException(s"$resource is missing from the build"))
    try new String(stream.readAllBytes(), UTF_8)
    finally stream.close()
  }
}

/** Builds the case classes of a configuration from complete JSON. */
private[config] object ConfigPickler extends upickle.AttributeTagged {
  implicit override def OptionReader[T: Reader]: Reader[Option[T]] =
    new Reader.Delegate[Any, Option[T]](implicitly[Reader[T]].map(Some(_))) {
      override def visitNull(index: Int): Option[T] = None
    }

  implicit private val array:     Reader[ArrayConfig]                   = macroR
  implicit private val precision: Reader[PrecisionConfig]               = macroR
  implicit private val geometry:  Reader[GeometryConfig]                = macroR
  implicit private val units:     Reader[UnitsConfig]                   = macroR
  implicit private val cache:     Reader[SceneCacheConfig]              = macroR
  implicit private val memory:    Reader[ColumnBvhMemoryConfig]         = macroR
  implicit private val encoding:  Reader[MapEncoding]                   = StringReader.map(MapEncoding.named(_).get)
  implicit private val maps:      Reader[PhysicalAttributeMemoryConfig] = macroR
  implicit private val frame:     Reader[FrameConfig]                   = macroR
  implicit private val queries:   Reader[QueriesConfig]                 = macroR
  implicit val config:            Reader[ColonnadeConfig]               = macroR
}

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
