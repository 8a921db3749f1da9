package colonnade.config

import colonnade.{ArbitraryConfig, Properties, TestConfigs}
import org.scalacheck.{Gen, Prop}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import java.nio.file.{Files, Paths}

class ConfigIOSpec extends AnyFlatSpec with Matchers with Properties {
  behavior of "ConfigIO"

  private def refusal(name: String, overrides: String*): String =
    the[ConfigError] thrownBy ConfigIO.load(name, overrides) match { case error => error.getMessage }

  it should "load every preset of configs" in {
    val files = new java.io.File("configs").list.toSeq.filter(_.endsWith(".json"))
    ConfigIO.presets shouldBe files.map(_.stripSuffix(".json")).sorted
    ConfigIO.presets.map(ConfigIO.load(_).array.rows) should contain allOf (1, 2, 10)
  }

  it should "accept an array of any rows and columns" in {
    for ((rows, columns) <- Seq((40, 40), (256, 1), (1, 256), (256, 256)))
      ConfigIO.load("small", Seq(s"array.rows=$rows", s"array.columns=$columns")).array shouldBe
        ArrayConfig(rows, columns)
  }

  it should "read back what it writes" in {
    for (settings <- Seq(Nil, Seq("geometry.triangleBits=24", "geometry.bvh=false", "precision=17b33s61d"))) {
      val config = ConfigIO.load("edge", settings)
      ConfigIO.read(ConfigIO.write(config)) shouldBe config
    }
  }

  it should "read back any configuration it writes, as a value and as text" in holds(cases = 300) {
    Prop.forAll(ArbitraryConfig.legal) { config =>
      val json = ConfigIO.write(config)
      ConfigIO.read(json) == config && ConfigIO.read(ujson.read(json.render())) == config
    }
  }

  it should "refuse duplicate keys, deep nesting and overlong numbers" in {
    def read(text: String): String =
      the[ConfigError] thrownBy StrictJson.read(text, "x.json") match { case error => error.getMessage }
    read("""{"a": {"b": 1, "b": 2}}""") shouldBe "x.json has the key b twice in an object"
    read("[" * 100000) should include("nested too deeply")
    read("""{"a":""" * 100 + "1" + "}" * 100) should include("nested too deeply")
    read("9" * 1000) should include("1000 characters")
    read("1e999") should include("too large")
    StrictJson.read("""{"a": "[[\"{{", "b": [1, -2.5e3, null, true, false, {}]}""", "x.json") shouldBe
      ujson.Obj("a" -> "[[\"{{", "b" -> ujson.Arr(1, -2500, ujson.Null, true, false, ujson.Obj()))
    refusal("tiny", s"array=${"[" * 100000}") should include("nested too deeply")
  }

  it should "refuse any number outside its range, by name" in holds(cases = 100) {
    val ranges = Seq(
      "array.contexts"              -> (1, 16),
      "precision.mac"               -> (16, 64),
      "precision.sqrt"              -> (16, 64),
      "precision.div"               -> (16, 64),
      "geometry.vertexBits"         -> (10, 24),
      "geometry.boxBits"            -> (4, 7),
      "geometry.triangleBits"       -> (16, 64),
      "columnBvhMemory.depth"       -> (16, 1 << 22),
      "columnBvhMemory.stackDepth"  -> (4, 256),
      "columnBvhMemory.readLatency" -> (1, 16),
      "frame.maxWidth"              -> (8, 4096),
      "frame.maxHeight"             -> (8, 4096),
      "frame.materials"             -> (1, 256),
      "frame.lights"                -> (1, 8),
      "frame.maxBounces"            -> (0, 15)
    )
    def isRefused(field: String, value: Int, range: (Int, Int)) =
      refusal("tiny", s"$field=$value") == s"$field is $value; it must be from ${range._1} to ${range._2}"
    for ((field, range) <- ranges; value <- Seq(range._1 - 1, range._2 + 1))
      assert(isRefused(field, value, range), field)
    val wrong = for {
      (field, (low, high)) <- Gen.oneOf(ranges)
      value                <- Gen.oneOf(Gen.chooseNum(Int.MinValue, low - 1), Gen.chooseNum(high + 1, Int.MaxValue))
    } yield (field, value, (low, high))
    Prop.forAllNoShrink(wrong) { case (field, value, range) => isRefused(field, value, range) }
  }

  it should "load a file" in {
    val file = Files.createTempFile("colonnade", ".json")
    try {
      Files.writeString(file, ConfigIO.write(ConfigIO.load("tiny", Seq("array.rows=3"))).render())
      ConfigIO.load(file.toString).array.rows shouldBe 3
    } finally Files.delete(file)
  }

  it should "accept the paper's notation as a name and as a value, and override a part of it" in {
    val expected = PrecisionConfig(mac = 16, sqrt = 24, div = 48)
    ConfigIO.load("16b24s48d").precision shouldBe expected
    ConfigIO.load("16b24s48d").array shouldBe ConfigIO.load("small").array
    ConfigIO.load("16b24s48d").numbers.gridBits shouldBe 16
    ConfigIO.load("tiny", Seq("precision=16b24s48d")).precision shouldBe expected
    ConfigIO.load("tiny", Seq("precision={\"mac\": 16, \"sqrt\": 24, \"div\": 48}")).precision shouldBe expected
    ConfigIO.load("tiny", Seq("precision.mac=20")).precision shouldBe PrecisionConfig(20, 32, 64)
  }

  it should "apply overrides in order" in {
    ConfigIO.load("tiny", Seq("array.rows=4", "array.rows=5", "frame.hits=false")).array.rows shouldBe 5
    ConfigIO.load(
      "tiny",
      Seq("geometry.triangleBits=40", "geometry.triangleBits=null")
    ).geometry.triangleBits shouldBe None
  }

  it should "refuse unknown keys by their path" in {
    refusal("tiny", "array.row=4") should startWith("unknown key array.row; known here: rows, columns, contexts")
    refusal("tiny", "ray.rows=4") should startWith("unknown key ray.rows")
    refusal("tiny", "array.rows.count=4") should startWith("unknown key array.rows.count")
    refusal("tiny", "colour=4") should startWith("unknown key colour; known here: array")
    refusal("tiny", "precision.add=4") should startWith("unknown key precision.add; known here: mac, sqrt, div")
  }

  it should "give missing keys their defaults, those of the preset tiny" in {
    ConfigIO.read(ujson.Obj()) shouldBe ColonnadeConfig()
    ConfigIO.load("tiny") shouldBe ColonnadeConfig()
    val changes = ujson.Obj("array" -> ujson.Obj("rows" -> 3), "columnBvhMemory" -> ujson.Obj("cache" -> ujson.Obj()))
    ConfigIO.read(changes) shouldBe
      ConfigIO.load("tiny", Seq("array.rows=3", "columnBvhMemory.cache={}"))
    ConfigIO.load("small", Seq("""physicalAttributeMemory={"width":320}""")).physicalAttributeMemory shouldBe
      Some(PhysicalAttributeMemoryConfig(width = 320))
  }

  it should "give any missing key its default" in holds(cases = 100) {
    val defaults = ConfigIO.write(ColonnadeConfig())
    Prop.forAll(ArbitraryConfig.legal, Gen.oneOf("array", "units", "frame"), Gen.chooseNum(0, 20)) {
      case (config, section, number) =>
        val (json, expected) = (ConfigIO.write(config), ConfigIO.write(config))
        val keys             = json(section).obj.keys.toSeq
        val key              = keys(number % keys.size)
        json(section).obj.remove(key)
        expected(section)(key) = defaults(section)(key)
        def result(of: ujson.Value) = scala.util.Try(ConfigIO.read(of)).toEither.left.map(_.getMessage)
        result(json) == result(expected)
    }
  }

  it should "read the presets of version 1" in {
    for (name <- Seq("edge", "fpga")) {
      val file   = s"src/test/resources/colonnade/configs/$name-1.json"
      val preset = ConfigIO.load(name)
      Files.readString(Paths.get(file)) should not include "version"
      // The presets differ in keys, and have more features; edge had four marches
      val units    = preset.units.copy(marches = if (name == "edge") 4 else preset.units.marches)
      val geometry = preset.geometry.copy(cornerColours = false, textureBytes = 0)
      val frame    = preset.frame.copy(emission = false, gather = false)
      ConfigIO.load(file) shouldBe preset.copy(units = units, geometry = geometry, frame = frame)
    }
  }

  it should "migrate keys of older versions" in {
    def migrated(settings: (String, ujson.Value)*) = ConfigIO.read(ujson.Obj.from(settings))
    val maps                                       = PhysicalAttributeMemoryConfig()
    for ((shared, columns) <- Seq(true -> 256, false -> 1))
      migrated(
        "physicalAttributeMemory" -> ujson.Obj("shared" -> shared, "shellPlanes" -> 5, "encoding" -> "twoLevel")
      ).physicalAttributeMemory shouldBe Some(maps.copy(columnsPerCopy = columns, boundingPlanes = 5))
    migrated("units" -> ujson.Obj("marches" -> 0, "pathContexts" -> 0, "directView" -> false)).units shouldBe
      UnitsConfig()
    migrated("units" -> ujson.Obj("marches" -> 3, "pathContexts" -> 9)).units shouldBe
      UnitsConfig(marches = 3, pathContexts = 9)
    migrated("physicalAttributeMemory" -> ujson.Obj("encoding" -> "slic")).physicalAttributeMemory shouldBe
      Some(maps.copy(encoding = MapEncoding.Slic))
    for ((bits, present) <- Seq(12 -> 7, 8 -> 7, 5 -> 5))
      migrated(
        "version"  -> 2,
        "geometry" -> ujson.Obj("boxBits" -> bits, "arity" -> 2, "trianglesPerRecord" -> 1)
      ).geometry shouldBe
        GeometryConfig(boxBits = present)
    val rays = migrated(
      "version" -> 3,
      "units"   -> ujson.Obj("pathContexts" -> 128, "rayInterval" -> 1),
      "frame"   -> ujson.Obj("rays" -> true, "lights" -> 2)
    )
    rays shouldBe ColonnadeConfig(
      units = UnitsConfig(rayInterval = 1),
      frame = FrameConfig(lights = 2),
      queries = Some(QueriesConfig(128))
    )
    migrated("frame" -> ujson.Obj("rays" -> false), "units" -> ujson.Obj("pathContexts" -> 9)) shouldBe
      ColonnadeConfig(units = UnitsConfig(pathContexts = 9))
  }

  it should "refuse newer versions, and keys of older versions in newer ones" in {
    def refused(version: ujson.Value, settings: (String, ujson.Value)*): String =
      the[ConfigError] thrownBy ConfigIO.read(ujson.Obj.from(("version" -> version) +: settings)) match {
        case error => error.getMessage
      }
    val next = ConfigMigration.version + 1
    refused(next, "novel" -> 1) shouldBe
      s"the configuration has version $next, this generator reads ${next - 1} at most: update it"
    for (version <- Seq[ujson.Value](0, 1.5, "2", ujson.Null))
      refused(version) shouldBe s"version is ${version.render()}; it must be a whole number from 1 to ${next - 1}"
    refused(2, "units" -> ujson.Obj("directView" -> true)) should startWith("unknown key units.directView; known here:")
    ConfigIO.write(ColonnadeConfig())("version") shouldBe ujson.Num(next - 1)
  }

  it should "refuse illegal values with the field, the value and the rule" in {
    refusal("tiny", "precision.mac=8") shouldBe "precision.mac is 8; it must be from 16 to 64"
    refusal("tiny", "precision=32b65s64d") shouldBe "precision.sqrt is 65; it must be from 16 to 64"
    refusal("32b32s8d") shouldBe "precision.div is 8; it must be from 16 to 64"
    refusal("tiny", "array.rows=0") shouldBe "array.rows is 0; it must be from 1 to 256"
    refusal("tiny", "array.contexts=17") shouldBe "array.contexts is 17; it must be from 1 to 16"
    refusal("tiny", "array.rows=3000") shouldBe "array.rows is 3000; it must be from 1 to 256"
    refusal("tiny", "array.columns=257") shouldBe "array.columns is 257; it must be from 1 to 256"
    refusal("tiny", "units.rayInterval=16") shouldBe "units.rayInterval is 16; it must be one of 1, 32"
    refusal("tiny", "units.shadeInterval=1") shouldBe "units.shadeInterval is 1; it must be one of 3, 128"
    refusal("tiny", "units.boxLanes=3") shouldBe "units.boxLanes is 3; it must be one of 1, 2, 4"
    refusal("tiny", "frame.tileSize=5") shouldBe "frame.tileSize is 5; it must be one of 4, 8, 16, 32"
  }

  it should "refuse all that is illegal at once, and nothing that only follows" in {
    refusal("tiny", "array.rows=0", "frame.lights=9") shouldBe
      "array.rows is 0; it must be from 1 to 256. frame.lights is 9; it must be from 1 to 8"
    refusal("edge", "precision.div=8", "columnBvhMemory.banks=3", "queries={}") should startWith(
      "precision.div is 8; it must be from 16 to 64. columnBvhMemory.banks is 3; it must be one of 1, 2, 4. queries"
    )
    refusal("edge", "physicalAttributeMemory.tileSize=0", "units.marches=17") shouldBe
      "units.marches is 17; it must be from 1 to 16. physicalAttributeMemory.tileSize is 0; it must be one of 16, 32"
  }

  it should "name settings that make a feature legal, all of them at once" in {
    refusal("tiny", "queries={}") shouldBe "queries needs units.rayInterval=1"
    refusal("edge", "queries={}") shouldBe
      "queries needs frame.maxBounces=0, frame.gather=false, physicalAttributeMemory=null"
    refusal("tiny", "frame.gather=true") shouldBe "frame.gather needs frame.maxBounces=1, units.shadeInterval=3"
    val designs = ConfigIO.presets.map(_ -> "frame.instances=0") ++
      Seq("64b64s64d" -> "frame.maxWidth=4096", "small" -> "frame.instances=4", "edge" -> "units.pathContexts=1")
    for (
      (name, other) <- designs; (feature, on) <- Seq("queries" -> "{}", "frame.gather" -> "true") if name != "traversal"
    ) {
      val settings = Seq(other, s"$feature=$on")
      val needed   =
        try { ConfigIO.load(name, settings); Nil }
        catch { case error: ConfigError => error.getMessage.stripPrefix(s"$feature needs ").split(", ").toSeq }
      noException should be thrownBy ConfigIO.load(name, settings ++ needed)
    }
  }

  private def environment(changes: String*): Seq[String] =
    s"physicalAttributeMemory=${ConfigIO.write(TestConfigs.withEnvironment(TestConfigs.environment))("physicalAttributeMemory").render()}" +:
      changes.map(change => s"physicalAttributeMemory.$change")

  it should "read the maps of an environment, or none" in {
    ConfigIO.load("tiny").physicalAttributeMemory shouldBe None
    ConfigIO.load("tiny", environment()).physicalAttributeMemory shouldBe Some(TestConfigs.environment)
    ConfigIO.load("tiny", environment() :+ "physicalAttributeMemory=null").physicalAttributeMemory shouldBe None
    ConfigIO.load("tiny", environment("encoding=slic")).physicalAttributeMemory shouldBe
      Some(TestConfigs.environment.copy(encoding = MapEncoding.Slic))
  }

  it should "refuse maps that do not fit, with the size that they need" in {
    def refused(changes: String*): String =
      refusal("tiny", environment(changes: _*): _*).stripPrefix("physicalAttributeMemory")
    refused(
      "mapBytes=1417"
    ) shouldBe ".mapBytes is 1417; it must be at least 1418: 50 tile descriptors take 200 bytes " +
      "and 256 palette entries 1152, the finest tile 66"
    refused("mapBytes=17737") should startWith(".mapBytes is 17737; it must be at most 17736: 50 tile descriptors")
    refused("planeBytes=1335") should startWith(".planeBytes is 1335; it must be at least 1336: 50 tile descriptors")
    refused("encoding=slic", "mapBytes=566") shouldBe ".mapBytes is 566; it must be at least 567: " +
      "50 seeds take 225 bytes and the labels of blocks 342"
    for (name <- Seq("\"jpeg\"", "2"))
      refused(s"encoding=$name") shouldBe s".encoding is $name; it must be one of twoLevel, slic"
    refused("tileSize=24") shouldBe ".tileSize is 24; it must be one of 16, 32"
    refusal("tiny", "physicalAttributeMemory.width=320") shouldBe
      "the setting 'physicalAttributeMemory.width=320' changes a part of what is null; set the whole section first"
  }

  it should "refuse values of the wrong type" in {
    refusal("tiny", "array.rows=four") shouldBe "array.rows is \"four\"; it must be a whole number"
    refusal("tiny", "array.rows=1.5") shouldBe "array.rows is 1.5; it must be a whole number"
    refusal("tiny", "array.rows=99999999999") should endWith("it must be a whole number")
    refusal("tiny", "array=1") shouldBe "array is 1; it must be an object with the keys rows, columns, contexts"
    refusal("tiny", "geometry.bvh=1") shouldBe "geometry.bvh is 1; it must be true or false"
    refusal("tiny", "precision=32") should startWith("precision is 32; it must be")
    refusal("tiny", "precision=wide") should startWith("precision is \"wide\"; it must be like 32b32s64d")
  }

  it should "refuse settings without a key or a value" in {
    refusal("tiny", "array.rows") should include("not of the form path.to.key=value")
    refusal("tiny", "=4") should include("not of the form path.to.key=value")
  }

  it should "refuse text that is not a configuration" in {
    refusal("nowhere.json") should startWith("there is no configuration 'nowhere.json'")
    val file = Files.createTempFile("colonnade", ".json")
    try {
      Files.writeString(file, "{\"array\": ")
      refusal(file.toString) should startWith(s"$file is not JSON: ")
      Files.writeString(file, "[1]")
      refusal(file.toString) should startWith("the configuration is [1]; it must be an object")
      Files.write(file, Array[Byte](-1, -2, 0))
      refusal(file.toString) should startWith(s"cannot read $file as text")
    } finally Files.delete(file)
    refusal(file.getParent.toString) should startWith("there is no configuration")
  }
}
