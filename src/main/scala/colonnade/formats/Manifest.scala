package colonnade.formats

import chisel3.Bundle
import colonnade.config.{ColonnadeConfig, ConfigIO, TextureLayout}
import colonnade.formats.Access.ReadWrite

import java.nio.charset.StandardCharsets.UTF_8
import java.security.MessageDigest

/** The description of a design for the host: configuration, number formats, and the bit position of every number in
  * records, registers and streams. The generator writes it beside the Verilog; packer, model and harness read it.
  */
object Manifest {
  val version: Int = 3 // incremented when a key changes its meaning or leaves

  def apply(config: ColonnadeConfig): ujson.Obj = {
    val formats = new RecordFormats(config)
    val numbers = ujson.Obj.from(config.numbers.entries.map { case (name, value) => name -> ujson.Num(value) })
    val records = ujson.Obj(
      "bits"    -> formats.recordBits,
      "layouts" -> ujson.Obj.from(formats.kinds.map { case (name, kind) => name -> fields(Layout.of(kind)) })
    )
    val registers = ujson.Obj(
      "dataBits" -> RegisterMap.dataBits,
      "fields"   -> ujson.Arr.from(RegisterMap(config).map(register))
    )
    val outputs =
      if (config.queries.nonEmpty) Seq("batch" -> new RayBatch, "ray" -> new RayRecord, "hit" -> new HitRecord)
      else Seq("pixel"                         -> new Pixel(config))
    val streams = ujson.Obj.from(
      (outputs :+ "load" -> new Load(config)).map { case (name, kind) => name -> fields(Layout.of(kind)) }
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
    val maps    = config.physicalAttributeMemory.map(_ => attributes(config))
    val texture = config.geometry.texture.map(textures)

    val manifest = ujson.Obj(
      "version"    -> version,
      "config"     -> ConfigIO.write(config),
      "numbers"    -> numbers,
      "records"    -> records,
      "registers"  -> registers,
      "streams"    -> streams,
      "memories"   -> memories,
      "attributes" -> maps.getOrElse[ujson.Value](ujson.Null)
    )
    texture.foreach(manifest("texture") = _)
    manifest("formatHash") = formatHash(manifest, config)
    manifest("configHash") = Json.hash(manifest)
    manifest
  }

  /** Of all that a scene image, a frame file and the writes of a driver depend on; of a manifest that has the rest. */
  private[formats] def formatHash(manifest: ujson.Value, config: ColonnadeConfig): String = Json.hash(ujson.Obj.from(
    Seq("records" -> manifest("records")) ++ Seq("attributes", "texture").flatMap(key =>
      manifest.obj.get(key).filterNot(_.isNull).map(key -> _)
    ) ++ Seq(
      "registers" -> ujson.Arr.from(manifest("registers")("fields").arr.filter(_("access").str == ReadWrite.label)),
      "numbers" -> ujson.Obj.from(config.numbers.ofImages.map { case (name, _) => name -> manifest("numbers")(name) }),
      "bvh"     -> ujson.Bool(config.geometry.bvh) // an image without nodes says nothing to hardware that walks them
    )
  ))

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

/** Writes JSON: indented for readers, canonical for hashes. */
object Json {

  /** Indented, with each innermost object or list on one line. */
  def pretty(json: ujson.Value): String = {
    def render(value: ujson.Value, indent: String): String = {
      val inner = indent + "  "
      value match {
        case flat if children(flat).forall(children(_).isEmpty) => oneLine(flat)
        case ujson.Obj(fields)                                  =>
          fields.map { case (key, field) => s"$inner${ujson.Str(key).render()}: ${render(field, inner)}" }
            .mkString("{\n", ",\n", s"\n$indent}")
        case list => list.arr.map(inner + render(_, inner)).mkString("[\n", ",\n", s"\n$indent]")
      }
    }
    render(json, "") + "\n"
  }

  /** SHA-256 of the JSON with sorted keys and no spaces. */
  def hash(json: ujson.Value): String =
    MessageDigest.getInstance("SHA-256").digest(sorted(json).render().getBytes(UTF_8)).map(b => f"$b%02x").mkString

  private def oneLine(json: ujson.Value): String = json match {
    case ujson.Obj(fields) =>
      fields.map { case (key, field) => s"${ujson.Str(key).render()}: ${oneLine(field)}" }.mkString("{", ", ", "}")
    case ujson.Arr(items) => items.map(oneLine).mkString("[", ", ", "]")
    case scalar           => scalar.render()
  }

  private def children(json: ujson.Value): Iterable[ujson.Value] = json match {
    case ujson.Obj(fields) => fields.values
    case ujson.Arr(items)  => items
    case _                 => Nil
  }

  private def sorted(json: ujson.Value): ujson.Value = json match {
    case ujson.Obj(fields) => ujson.Obj.from(fields.toSeq.sortBy(_._1).map { case (key, v) => key -> sorted(v) })
    case ujson.Arr(items)  => ujson.Arr.from(items.map(sorted))
    case scalar            => scalar
  }
}
