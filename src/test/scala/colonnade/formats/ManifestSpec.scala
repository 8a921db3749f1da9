package colonnade.formats

import colonnade.{ArbitraryConfig, Properties, TestConfigs}
import colonnade.config.{ColonnadeConfig, ConfigError, ConfigIO, MapEncoding, PhysicalAttributeMemoryConfig}
import org.scalacheck.Prop
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import java.nio.file.{Files, Paths}

class ManifestSpec extends AnyFlatSpec with Matchers with Properties {
  behavior of "Manifest"

  private val environment =
    TestConfigs.environment.copy(width = 640, height = 480, mapBytes = 16384, planeBytes = 8192)

  private def manifest(settings: String*): ujson.Obj = Manifest(ConfigIO.load("tiny", settings))

  it should "contain its configuration" in {
    ConfigIO.read(manifest("array.rows=7")("config")) shouldBe ConfigIO.load("tiny", Seq("array.rows=7"))
  }

  it should "contain the keys that the host reads" in {
    val whole = manifest()
    whole.value.keys.toSeq shouldBe
      Seq(
        "version",
        "config",
        "numbers",
        "records",
        "registers",
        "streams",
        "memories",
        "attributes",
        "formatHash",
        "configHash"
      )
    whole("records")("layouts").obj.keys.toSeq shouldBe Seq("node", "nearPair", "triangle", "flatPair", "farPair")
    whole("memories")("columnBvh") shouldBe ujson.Obj("depth" -> 131072, "bits" -> 256, "banks" -> 2)
    val names = whole("registers")("fields").arr.map(_("name").str)
    names should contain.allOf(
      "control.start",
      "status.busy",
      "errors.stackOverflow",
      "counters.raysInBox",
      "frame.width",
      "frame.objectRect.x1",
      "camera.direction.z",
      "camera.stepShift",
      "lights[0].reachExponent",
      "shading.offset",
      "ambient.g",
      "shading.shadows",
      "background.b",
      "materials[7].albedo.r",
      "bounds.high.y",
      "scene.recordCount"
    )
    names should not contain "materials[8].albedo.r"
  }

  it should "describe the memories of the environment's maps, their words and their sizes" in {
    val whole  = Manifest(TestConfigs.withEnvironment(environment))
    val target =
      whole("memories").obj.collect { case (name, memory) if name != "columnBvh" => name -> memory("target").num }
    target shouldBe Map(
      "albedo.descriptors"  -> 1,
      "albedo.palette"      -> 2,
      "albedo.heap"         -> 3,
      "normals.descriptors" -> 4,
      "normals.palette"     -> 5,
      "normals.heap"        -> 6,
      "planes.descriptors"  -> 7,
      "planes.heap"         -> 8,
      "planes.planes"       -> 9,
      "planes.bounding"     -> 10
    )
    whole("memories")("albedo.heap") shouldBe ujson.Obj("depth" -> 5216, "bits" -> 16, "target" -> 3)
    whole("memories")("planes.heap") shouldBe ujson.Obj("depth" -> 2312, "bits" -> 16, "target" -> 8)
    whole("memories")("planes.bounding") shouldBe ujson.Obj("depth" -> 8, "bits" -> 136, "target" -> 10)
    whole("attributes")("sizes")("tileColumns").num shouldBe 40
    whole("attributes")("layouts").obj.keys.toSeq shouldBe
      Seq("mapDescriptor", "albedo", "normal", "planeDescriptor", "plane", "boundingPlaneEntry")
    whole("registers")("fields").arr.map(_("name").str) should contain("counters.cellReads")
    manifest()("registers")("fields").arr.map(_("name").str) should not contain "counters.cellReads"
  }

  it should "describe SLIC maps by their seeds and labels" in {
    val whole          = Manifest(TestConfigs.withEnvironment(environment.copy(encoding = MapEncoding.Slic)))
    val (maps, planes) = whole("memories").obj.keys.toSeq.filter(_ != "columnBvh").splitAt(4)
    maps shouldBe Seq("albedo.seeds", "albedo.labels", "normals.seeds", "normals.labels")
    planes.forall(_.startsWith("planes.")) shouldBe true
    whole("memories")("albedo.seeds") shouldBe ujson.Obj("depth" -> 1200, "bits" -> 36, "target" -> 1)
    whole("memories")("normals.labels") shouldBe ujson.Obj("depth" -> 4800, "bits" -> 16, "target" -> 4)
    val sizes = whole("attributes")("sizes").obj
    (sizes("blockLog").num, sizes("blockColumns").num, sizes("labelWords").num) shouldBe ((2, 160, 4800))
    sizes.keys should contain noElementsOf Seq("paletteSize", "mapHeapWords")
    Manifest(TestConfigs.withEnvironment(environment))("attributes")("sizes").obj.keys should contain noElementsOf
      Seq("blockLog", "blockColumns", "labelWords")
  }

  it should "hash the settings of an environment's image, and not the number of its copies" in {
    def hash(environment: PhysicalAttributeMemoryConfig): String =
      Manifest(TestConfigs.withEnvironment(environment))("formatHash").str
    hash(environment.copy(columnsPerCopy = 2)) shouldBe hash(environment)
    val others = Seq(
      environment.copy(paletteSize = 128),
      environment.copy(height = 464),
      environment.copy(planeBytes = 8190),
      environment.copy(encoding = MapEncoding.Slic)
    )
    (others.map(hash) :+ hash(environment) :+ Manifest(TestConfigs.tiny)("formatHash").str).distinct.size shouldBe 6
  }

  it should "have textures only where the configuration does" in {
    val (without, textured) =
      (manifest("geometry.cornerColours=true"), manifest("geometry.cornerColours=true", "geometry.textureBytes=16384"))
    without.obj.keys should not contain "texture"
    textured("texture")("sizes")("mapHeapWords").num shouldBe (16384 - 4096 - 1152) / 2
    textured("memories").obj.keys should contain.allOf("texture.descriptors", "texture.palette", "texture.heap")
    textured("formatHash") should not be without("formatHash")
    for (bytes <- Seq(5313, 21633))
      the[ConfigError] thrownBy manifest(
        "geometry.cornerColours=true",
        s"geometry.textureBytes=$bytes"
      ) should have message
        s"geometry.textureBytes is $bytes; it must be 0, or from 5314 to 21632"
    the[ConfigError] thrownBy manifest("geometry.textureBytes=16384") should have message
      "geometry.textureBytes needs geometry.cornerColours=true"
  }

  it should "give faces and materials corner colours only where the configuration has them" in {
    def names(whole: ujson.Value): Seq[String] =
      (whole("records")("layouts").obj.get("colours").toSeq.flatMap(_.arr) ++ whole("registers")("fields").arr)
        .map(_("name").str)
    val (without, coloured) = (manifest(), manifest("geometry.cornerColours=true"))
    names(without).filter(name => name.contains("olours")) shouldBe empty
    names(coloured) should contain.allOf(
      "colours[0].r",
      "colours[3].b",
      "materials[7].hasCornerColours"
    )
    coloured("records")("bits").num shouldBe 256
    coloured("formatHash") should not be without("formatHash")
  }

  it should "give each register words of its own, in order" in {
    for (precision <- Seq("16b16s16d", "33b32s64d", "64b64s64d")) {
      val registers = manifest(s"precision=$precision", "geometry.triangleBits=null")("registers")("fields").arr.toSeq
      val words     = registers.flatMap(r => Seq.tabulate(r("words").num.toInt)(r("address").num.toInt + _))
      words shouldBe words.distinct.sorted
      registers.foreach(r => r("words").num shouldBe math.ceil(r("width").num / 32))
    }
  }

  it should "give what the host reads the same addresses in every design, and fixed ones to the blocks" in
    holds(cases = 100) {
      val complete = RegisterMap(ColonnadeConfig.complete).map(register => register.name -> register.address).toMap
      Prop.forAll(ArbitraryConfig.legal) { config =>
        val registers = RegisterMap(config)
        val settings  = registers.filter(_.access == Access.ReadWrite)
        registers.diff(settings).forall(register => complete(register.name) == register.address) &&
        complete("control.start") == 0 && complete("status.busy") == 8 && complete("errors.stackOverflow") == 16 &&
        complete("counters.cycles") == 32 && settings.head.address == 256 &&
        settings.map(_.address) == settings.scanLeft(256)((address, register) => address + register.words).init
      }
    }

  it should "keep the formats and addresses of a release's files" in {
    val release = ujson.read(Files.readString(Paths.get("host/tests/data/formats/manifest.json")))
    val today   = Manifest(ConfigIO.load("host/tests/data/formats/config.json"))
    today("formatHash") shouldBe release("formatHash")
    today("registers")("fields").arr should contain allElementsOf release("registers")("fields").arr
  }

  /** All objects of a part of the manifest that describe a field or a register. */
  private def fieldsOf(json: ujson.Value): Seq[ujson.Obj] = json match {
    case field: ujson.Obj if field.value.contains("name") => Seq(field)
    case ujson.Obj(parts)                                 => parts.values.flatMap(fieldsOf).toSeq
    case ujson.Arr(items)                                 => items.flatMap(fieldsOf).toSeq
    case _                                                => Nil
  }

  it should "hash every field of records, maps, textures and frame registers, and nothing that the host only reads" in {
    val config =
      ConfigIO.load("small", Seq("columnBvhMemory.cache={}", "units.marches=2"))
    val whole = Manifest(config)
    val hash  = whole("formatHash").str
    whole.value.remove("configHash")
    def changed(part: ujson.Value, key: String, value: ujson.Value): String = {
      val old = part(key)
      part(key) = value
      try Manifest.formatHash(whole, config)
      finally part(key) = old
    }
    def hashes(part: ujson.Value, keys: String*): Seq[String] = for {
      field <- fieldsOf(part)
      key   <- keys
    } yield changed(
      field,
      key,
      field(key) match {
        case ujson.Num(number) => number + 1
        case ujson.Bool(flag)  => !flag
        case _                 => "other"
      }
    )
    Manifest.formatHash(whole, config) shouldBe hash
    val places = Seq("name", "offset", "width", "signed", "fraction")
    for (part <- Seq(whole("records"), whole("attributes")("layouts"), whole("texture")("layouts")))
      hashes(part, places: _*) should (not be empty and not contain hash)
    for (part <- Seq("attributes", "texture"); sizes = whole(part)("sizes"); name <- sizes.obj.keys.toSeq)
      changed(sizes, name, -1) should not be hash
    changed(whole("records"), "bits", 1024) should not be hash

    val (settings, others) = whole("registers")("fields").arr.toSeq.partition(_("access").str == "rw")
    hashes(settings, "name", "address", "words", "width", "signed", "limit") should (not be empty and not contain hash)
    hashes(others, "name", "address", "words", "width").toSet shouldBe Set(hash)
    hashes(whole("streams"), places: _*).toSet shouldBe Set(hash)

    // Another counter, and another number of the datapaths
    val registers = whole("registers")("fields").arr
    registers.insert(0, ujson.Obj("name" -> "counters.other", "address" -> 254, "words" -> 2, "access" -> "ro"))
    whole("numbers")("otherBits") = 5
    Manifest.formatHash(whole, config) shouldBe hash
    for ((name, value) <- config.numbers.ofImages) changed(whole("numbers"), name, value + 1) should not be hash
  }

  it should "change the format hash with the settings of a scene image, and only then" in {
    val base    = manifest()
    val larger  = manifest("array.rows=2", "precision.sqrt=40", "columnBvhMemory.readLatency=4")
    val narrow  = manifest("geometry.vertexBits=15")
    val precise = manifest("precision.div=62")
    val flat    = manifest("geometry.bvh=false")
    base("formatHash").str should fullyMatch regex "[0-9a-f]{64}"
    larger("formatHash") shouldBe base("formatHash")
    larger("configHash") should not be base("configHash")
    Seq(narrow, precise, flat).foreach(_("formatHash") should not be base("formatHash"))
  }

  it should "be written as JSON that reads back the same" in {
    ujson.read(Json.pretty(manifest())) shouldBe manifest()
  }
}
