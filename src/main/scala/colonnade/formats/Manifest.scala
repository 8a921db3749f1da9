package colonnade.formats

import colonnade.config.{ColonnadeConfig, ConfigIO}

/** What the host must know of a design: configuration, number formats, and where every number of a record, register
  * or stream lies. Written next to the Verilog; packer, model and harness take it from there.
  */
object Manifest {

  /** Raised when a key changes its meaning. */
  val version: Int = 1

  def apply(config: ColonnadeConfig): ujson.Obj = {
    val formats = new RecordFormats(config)
    val numbers = ujson.Obj.from(config.numbers.entries.map { case (name, value) => name -> ujson.Num(value) })
    val records = ujson.Obj(
      "bits"    -> formats.recordBits,
      "layouts" -> ujson.Obj(
        "node"       -> fields(Layout.of(formats.node)),
        "triangles"  -> fields(Layout.of(formats.triangles)),
        "attributes" -> fields(Layout.of(formats.attributes))
      )
    )
    val registers = ujson.Obj(
      "dataBits" -> RegisterMap.dataBits,
      "fields"   -> ujson.Arr.from(RegisterMap(config).map(register))
    )
    val streams = ujson.Obj(
      "pixel" -> fields(Layout.of(new Pixel(config))),
      "load"  -> fields(Layout.of(new Load(config)))
    )
    val memory = ujson.Obj(
      "depth" -> config.columnBvhMemory.depth,
      "bits"  -> formats.recordBits,
      "banks" -> config.columnBvhMemory.banks
    )
    val formatHash = Json.hash(
      ujson.Obj(
        "records"   -> records,
        "registers" -> registers,
        "numbers"   -> numbers,
        "bvh"       -> config.geometry.bvh // an image without nodes says nothing to hardware that walks them
      )
    )

    val manifest = ujson.Obj(
      "version"    -> version,
      "config"     -> ConfigIO.write(config),
      "numbers"    -> numbers,
      "records"    -> records,
      "registers"  -> registers,
      "streams"    -> streams,
      "memories"   -> ujson.Obj("columnBvh" -> memory),
      "formatHash" -> formatHash
    )
    manifest("configHash") = Json.hash(manifest)
    manifest
  }

  private def fields(layout: Seq[Field]): ujson.Arr = ujson.Arr.from(layout.map { field =>
    ujson.Obj(
      "name"     -> field.name,
      "offset"   -> field.offset,
      "width"    -> field.width,
      "signed"   -> field.signed,
      "fraction" -> field.fraction
    )
  })

  private def register(register: Register): ujson.Obj = ujson.Obj(
    "name"    -> register.name,
    "address" -> register.address,
    "words"   -> register.words,
    "width"   -> register.width,
    "signed"  -> register.signed,
    "access"  -> register.access.label
  )
}
