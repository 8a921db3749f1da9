package colonnade.config

import java.io.IOException
import java.nio.charset.StandardCharsets.UTF_8
import java.nio.file.{Files, InvalidPathException, Paths}

/** Configurations as JSON, for which [[ColonnadeConfig]] has the names, types and defaults of all keys; `precision` may also
  * be written in the paper's notation, as in `"32b32s64d"`. No other key is accepted. Files of older versions are
  * migrated, see `ConfigMigration`. All failures are [[ConfigError]]s.
  */
object ConfigIO {

  /** The names of the presets: the files of `configs`. */
  lazy val presets: Seq[String] = resource("names").linesIterator.toSeq
  private val maxBytes = 1 << 20 // maximum size of a configuration file

  /** The configuration of a preset's name, of a file, or of a precision such as `16b16s32d`: `small` with that precision
    * and with triangle tests as wide as `precision.mac`.
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
    ConfigSchema.completed(json, ColonnadeConfig.complete, ColonnadeConfig())

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
