package colonnade.config

import java.io.IOException
import java.nio.charset.StandardCharsets.UTF_8
import java.nio.file.{Files, InvalidPathException, Path, Paths}

/** Configurations as JSON. Every key is required and no other is accepted; `precision` may also be written in the
  * paper's notation, as in `"32b32s64d"`. All failures are [[ConfigError]]s.
  */
object ConfigIO {

  /** The names of the presets: the files of `configs`. */
  lazy val presets: Seq[String] = resource("names").linesIterator.toSeq

  /** Maximum size of a configuration file. */
  private val maxBytes = 1 << 20

  private val notation = """(\d{1,6})b(\d{1,6})s(\d{1,6})d""".r

  /** The configuration of a preset's name, of a file, or of a precision such as `16b16s32d`: `small` with that precision
    * and with triangle tests as wide as `precision.mac`.
    *
    * @param overrides `path.to.key=value`, applied in order; a value is JSON, or else a string without quotes
    */
  def load(name: String, overrides: Seq[String] = Nil): ColonnadeConfig = {
    val json = name match {
      case preset if presets.contains(preset) => parse(presetText(preset), preset)
      case notation(_, _, _)                  =>
        Seq(
          s"precision=$name",
          "geometry.triangleBits=null"
        ).foldLeft(parse(presetText("small"), "small"))(withOverride)
      case file => parse(fileText(file), file)
    }
    read(overrides.foldLeft(json)(withOverride))
  }

  def read(json: ujson.Value): ColonnadeConfig = {
    val root = new ConfigReader(
      "",
      json,
      Seq("array", "precision", "geometry", "units", "columnBvhMemory", "physicalAttributeMemory", "frame")
    )
    val array = root.section("array", "rows", "columns", "contexts")
    val shape = root.section(
      "geometry",
      "vertexBits",
      "boxBits",
      "triangleBits",
      "arity",
      "trianglesPerRecord",
      "bvh",
      "cornerColours",
      "textureBytes"
    )
    val units = root.section(
      "units",
      "boxLanes",
      "triangleLanes",
      "triangleRows",
      "marches",
      "pathContexts",
      "rayInterval",
      "shadeInterval",
      "extraSlices"
    )
    val memory = root.section(
      "columnBvhMemory",
      "depth",
      "banks",
      "stackDepth",
      "snooping",
      "recordBuffers",
      "readLatency",
      "holdable",
      "cache"
    )
    val frame = root.section(
      "frame",
      "maxWidth",
      "maxHeight",
      "tileSize",
      "materials",
      "lights",
      "maxBounces",
      "hits",
      "emission"
    )

    Require.within("array.contexts", array.int("contexts"), 1, ArrayConfig.maxContexts)
    ColonnadeConfig(
      array = ArrayConfig(
        rows = array.int("rows"),
        columns = array.int("columns"),
        contexts = array.int("contexts")
      ),
      precision = precision(root),
      geometry = GeometryConfig(
        vertexBits = shape.int("vertexBits"),
        boxBits = shape.int("boxBits"),
        triangleBits = shape.optionalInt("triangleBits"),
        arity = shape.int("arity"),
        trianglesPerRecord = shape.int("trianglesPerRecord"),
        bvh = shape.boolean("bvh"),
        cornerColours = shape.boolean("cornerColours"),
        textureBytes = shape.int("textureBytes")
      ),
      units = UnitsConfig(
        boxLanes = units.int("boxLanes"),
        triangleLanes = units.int("triangleLanes"),
        triangleRows = units.int("triangleRows"),
        marches = units.int("marches"),
        pathContexts = units.int("pathContexts"),
        rayInterval = units.int("rayInterval"),
        shadeInterval = units.int("shadeInterval"),
        extraSlices = units.boolean("extraSlices")
      ),
      columnBvhMemory = ColumnBvhMemoryConfig(
        depth = memory.int("depth"),
        banks = memory.int("banks"),
        stackDepth = memory.int("stackDepth"),
        snooping = memory.boolean("snooping"),
        recordBuffers = memory.int("recordBuffers"),
        readLatency = memory.int("readLatency"),
        holdable = memory.boolean("holdable"),
        cache = memory
          .optionalSection(
            "cache",
            "lines",
            "ways",
            "misses",
            "sharedLines",
            "sharedWays",
            "sharedMisses",
            "busBytes",
            "parity"
          )
          .map(sceneCache)
      ),
      physicalAttributeMemory = root
        .optionalSection(
          "physicalAttributeMemory",
          "width",
          "height",
          "encoding",
          "tileSize",
          "paletteSize",
          "mapBytes",
          "planes",
          "planeBytes",
          "boundingPlanes",
          "columnsPerCopy"
        )
        .map(physicalAttributeMemory),
      frame = FrameConfig(
        maxWidth = frame.int("maxWidth"),
        maxHeight = frame.int("maxHeight"),
        tileSize = frame.int("tileSize"),
        materials = frame.int("materials"),
        lights = frame.int("lights"),
        maxBounces = frame.int("maxBounces"),
        hits = frame.boolean("hits"),
        emission = frame.boolean("emission")
      )
    )
  }

  /** The JSON that [[read]] takes, with `precision` spelled out. */
  def write(config: ColonnadeConfig): ujson.Obj = {
    import config.{array, units, columnBvhMemory, frame, geometry, precision => widths}
    ujson.Obj(
      "array" -> ujson.Obj(
        "rows"     -> array.rows,
        "columns"  -> array.columns,
        "contexts" -> array.contexts
      ),
      "precision" -> ujson.Obj("mac" -> widths.mac, "sqrt" -> widths.sqrt, "div" -> widths.div),
      "geometry"  -> ujson.Obj(
        "vertexBits"         -> geometry.vertexBits,
        "boxBits"            -> geometry.boxBits,
        "triangleBits"       -> geometry.triangleBits.fold[ujson.Value](ujson.Null)(ujson.Num(_)),
        "arity"              -> geometry.arity,
        "trianglesPerRecord" -> geometry.trianglesPerRecord,
        "bvh"                -> geometry.bvh,
        "cornerColours"      -> geometry.cornerColours,
        "textureBytes"       -> geometry.textureBytes
      ),
      "units" -> ujson.Obj(
        "boxLanes"      -> units.boxLanes,
        "triangleLanes" -> units.triangleLanes,
        "triangleRows"  -> units.triangleRows,
        "marches"       -> units.marches,
        "pathContexts"  -> units.pathContexts,
        "rayInterval"   -> units.rayInterval,
        "shadeInterval" -> units.shadeInterval,
        "extraSlices"   -> units.extraSlices
      ),
      "columnBvhMemory" -> ujson.Obj(
        "depth"         -> columnBvhMemory.depth,
        "banks"         -> columnBvhMemory.banks,
        "stackDepth"    -> columnBvhMemory.stackDepth,
        "snooping"      -> columnBvhMemory.snooping,
        "recordBuffers" -> columnBvhMemory.recordBuffers,
        "readLatency"   -> columnBvhMemory.readLatency,
        "holdable"      -> columnBvhMemory.holdable,
        "cache"         -> columnBvhMemory.cache.fold[ujson.Value](ujson.Null)(written)
      ),
      "physicalAttributeMemory" -> config.physicalAttributeMemory.fold[ujson.Value](ujson.Null)(written),
      "frame"                   -> ujson.Obj(
        "maxWidth"   -> frame.maxWidth,
        "maxHeight"  -> frame.maxHeight,
        "tileSize"   -> frame.tileSize,
        "materials"  -> frame.materials,
        "lights"     -> frame.lights,
        "maxBounces" -> frame.maxBounces,
        "hits"       -> frame.hits,
        "emission"   -> frame.emission
      )
    )
  }

  private def physicalAttributeMemory(memory: ConfigReader) = PhysicalAttributeMemoryConfig(
    width = memory.int("width"),
    height = memory.int("height"),
    encoding = memory.choice("encoding", MapEncoding.all)(_.name),
    tileSize = memory.int("tileSize"),
    paletteSize = memory.int("paletteSize"),
    mapBytes = memory.int("mapBytes"),
    planes = memory.int("planes"),
    planeBytes = memory.int("planeBytes"),
    boundingPlanes = memory.int("boundingPlanes"),
    columnsPerCopy = memory.int("columnsPerCopy")
  )

  private def written(memory: PhysicalAttributeMemoryConfig) = ujson.Obj(
    "width"          -> memory.width,
    "height"         -> memory.height,
    "encoding"       -> memory.encoding.name,
    "tileSize"       -> memory.tileSize,
    "paletteSize"    -> memory.paletteSize,
    "mapBytes"       -> memory.mapBytes,
    "planes"         -> memory.planes,
    "planeBytes"     -> memory.planeBytes,
    "boundingPlanes" -> memory.boundingPlanes,
    "columnsPerCopy" -> memory.columnsPerCopy
  )

  private def sceneCache(cache: ConfigReader) = SceneCacheConfig(
    lines = cache.int("lines"),
    ways = cache.int("ways"),
    misses = cache.int("misses"),
    sharedLines = cache.int("sharedLines"),
    sharedWays = cache.int("sharedWays"),
    sharedMisses = cache.int("sharedMisses"),
    busBytes = cache.int("busBytes"),
    parity = cache.boolean("parity")
  )

  private def written(cache: SceneCacheConfig) = ujson.Obj(
    "lines"        -> cache.lines,
    "ways"         -> cache.ways,
    "misses"       -> cache.misses,
    "sharedLines"  -> cache.sharedLines,
    "sharedWays"   -> cache.sharedWays,
    "sharedMisses" -> cache.sharedMisses,
    "busBytes"     -> cache.busBytes,
    "parity"       -> cache.parity
  )

  private def precision(root: ConfigReader): PrecisionConfig = root.value("precision") match {
    case ujson.Str(notation(mac, sqrt, div)) => PrecisionConfig(mac.toInt, sqrt.toInt, div.toInt)
    case text: ujson.Str                     =>
      throw ConfigReader.wrong("precision", text, "like 32b32s64d, or an object with the keys mac, sqrt, div")
    case _ =>
      val bits = root.section("precision", "mac", "sqrt", "div")
      PrecisionConfig(mac = bits.int("mac"), sqrt = bits.int("sqrt"), div = bits.int("div"))
  }

  private def withOverride(json: ujson.Value, setting: String): ujson.Value = {
    val (path, value) = setting.split("=", 2) match {
      case Array(path, text) if path.nonEmpty => (path.split("\\.", -1).toList, valueOf(text))
      case _                                  =>
        throw new ConfigError(s"the setting '$setting' is not of the form path.to.key=value, as in array.rows=4")
    }

    def replaced(at: ujson.Value, rest: List[String]): ujson.Value = (at, rest) match {
      case (_, Nil)                        => value
      case (ujson.Obj(fields), key :: Nil) => ujson.Obj.from(fields.toSeq.filter(_._1 != key) :+ (key -> value))
      // One part of a precision in the paper's notation.
      case (ujson.Str(notation(mac, sqrt, div)), keys) =>
        replaced(ujson.Obj("mac" -> mac.toInt, "sqrt" -> sqrt.toInt, "div" -> div.toInt), keys)
      case (ujson.Obj(fields), key :: keys) if fields.contains(key) =>
        ujson.Obj.from(fields.toSeq.map { case (k, v) => k -> (if (k == key) replaced(v, keys) else v) })
      case (ujson.Null, _) =>
        throw new ConfigError(s"the setting '$setting' changes a part of what is null; set the whole section first")
      case _ => throw new ConfigError(s"unknown key ${path.mkString(".")} in the setting '$setting'")
    }
    replaced(json, path)
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
    try text(path)
    catch { case failure: IOException => throw new ConfigError(s"cannot read $name as text: ${failure.getMessage}") }
  }

  private def text(path: Path): String = Files.readString(path, UTF_8)

  private def presetText(name: String): String = resource(s"$name.json")

  /** A file that the build puts beside the classes. */
  private def resource(name: String): String = {
    val resource = s"/colonnade/configs/$name"
    val stream   = Option(getClass.getResourceAsStream(resource))
      .getOrElse(throw new IllegalStateException(s"$resource is missing from the build"))
    try new String(stream.readAllBytes(), UTF_8)
    finally stream.close()
  }
}
