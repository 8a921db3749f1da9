package colonnade.formats

import chisel3.Bundle
import colonnade.config.{ColonnadeConfig, ConfigIO, TextureLayout}

/** The description of a design for the host: configuration, number formats, and the bit position of every number in
  * records, registers and streams. The generator writes it beside the Verilog; packer, model and harness read it.
  */
object Manifest {

  /** Incremented when a key changes its meaning. */
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
    val memories = ujson.Obj(
      "columnBvh" -> ujson.Obj(
        "depth" -> config.columnBvhMemory.depth,
        "bits"  -> formats.recordBits,
        "banks" -> config.columnBvhMemory.banks
      )
    )
    if (config.columnBvhMemory.cache.nonEmpty)
      memories("columnBvh")("line") =
        ujson.Obj(
          "records" -> SceneLines.records,
          "bytes"   -> SceneLines.bytes(config),
          "pitch"   -> SceneLines.pitch(config)
        )
    for (memory <- AttributeMemories(config))
      memories(memory.name) = ujson.Obj("depth" -> memory.depth, "bits" -> memory.bits, "target" -> memory.target)
    val maps   = config.physicalAttributeMemory.map(_ => attributes(config))
    val hashed = ujson.Obj(
      "records"   -> records,
      "registers" -> registers,
      "numbers"   -> numbers,
      "bvh"       -> config.geometry.bvh // an image without nodes says nothing to hardware that walks them
    )
    val texture = config.geometry.texture.map(textures)
    maps.foreach(hashed("attributes") = _)
    texture.foreach(hashed("texture") = _)
    val formatHash = Json.hash(hashed)

    val manifest = ujson.Obj(
      "version"    -> version,
      "config"     -> ConfigIO.write(config),
      "numbers"    -> numbers,
      "records"    -> records,
      "registers"  -> registers,
      "streams"    -> streams,
      "memories"   -> memories,
      "attributes" -> maps.getOrElse[ujson.Value](ujson.Null),
      "formatHash" -> formatHash
    )
    texture.foreach(manifest("texture") = _)
    manifest("configHash") = Json.hash(manifest)
    manifest
  }

  /** The settings that determine an image of the environment's maps; the number of copies is not one of them. */
  private def attributes(config: ColonnadeConfig): ujson.Obj = ujson.Obj(
    "sizes" -> ujson.Obj.from(config.physicalAttributeMemory.toSeq.flatMap(_.layout.entries).map {
      case (name, value) => name -> ujson.Num(value)
    }),
    "layouts" -> wordLayouts(AttributeMemories.layouts)
  )

  /** The settings that determine an image of the textures; a manifest without them has no such key. */
  private def textures(layout: TextureLayout): ujson.Obj = ujson.Obj(
    "sizes"   -> ujson.Obj.from(layout.entries.map { case (name, value) => name -> ujson.Num(value) }),
    "layouts" -> wordLayouts(AttributeMemories.textureLayouts)
  )

  private def wordLayouts(kinds: Seq[(String, () => Bundle)]): ujson.Obj =
    ujson.Obj.from(kinds.map { case (name, kind) => name -> fields(Layout.of(kind())) })

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
    "access"  -> register.access.label,
    "limit"   -> register.limit.fold[ujson.Value](ujson.Null)(limit => ujson.Num(limit.toDouble))
  )
}
