package colonnade.formats

import colonnade.config.ConfigIO
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

class ManifestSpec extends AnyFlatSpec with Matchers {
  behavior of "Manifest"

  private def manifest(settings: String*): ujson.Obj = Manifest(ConfigIO.load("tiny", settings))

  it should "carry the configuration it was made from" in {
    ConfigIO.read(manifest("array.rows=7")("config")) shouldBe ConfigIO.load("tiny", Seq("array.rows=7"))
  }

  it should "name what the host relies on" in {
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
    whole("records")("layouts").obj.keys.toSeq shouldBe Seq("node", "triangles", "attributes")
    whole("memories")("columnBvh") shouldBe ujson.Obj("depth" -> 131072, "bits" -> 320, "banks" -> 2)
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
      "light.shadowOffset",
      "ambient.g",
      "shading.shadows",
      "background.b",
      "materials[7].albedo.r",
      "bounds.high.y",
      "scene.attributeBase"
    )
    names should not contain "materials[8].albedo.r"
  }

  it should "give every word of the register map to one register" in {
    for (precision <- Seq("16b16s16d", "33b32s64d", "64b64s64d")) {
      val registers = manifest(s"precision=$precision")("registers")("fields").arr.toSeq
      val words     = registers.flatMap(r => Seq.tabulate(r("words").num.toInt)(r("address").num.toInt + _))
      words shouldBe words.indices
      registers.foreach(r => r("words").num shouldBe math.ceil(r("width").num / 32))
    }
  }

  it should "change the format hash with what an image depends on, and only then" in {
    val base    = manifest()
    val larger  = manifest("array.rows=2", "columnBvhMemory.snooping=false", "columnBvhMemory.readLatency=4")
    val narrow  = manifest("geometry.vertexBits=15")
    val precise = manifest("precision.div=62")
    base("formatHash").str should fullyMatch regex "[0-9a-f]{64}"
    larger("formatHash") shouldBe base("formatHash")
    larger("configHash") should not be base("configHash")
    Seq(narrow, precise).foreach(_("formatHash") should not be base("formatHash"))
  }

  it should "be written as JSON that reads back the same" in {
    ujson.read(Json.pretty(manifest())) shouldBe manifest()
  }
}
