package colonnade.formats

import colonnade.config.ColonnadeConfig

/** The memory formats of a configuration as a Markdown page, from the same definitions as the manifest. */
object FormatsPage {

  def apply(config: ColonnadeConfig): String = {
    val formats = new RecordFormats(config)
    val page    = Seq(
      "# Memory formats",
      s"""*Written by the generator (`colonnade.Generate --config small --formats-page docs/formats.md`) from the Chisel
         |bundles in `src/main/scala/colonnade/formats`; a spec holds it against them. Widths follow the configuration:
         |these are of precision ${config.precision}. Bit 0 is the least significant.*""".stripMargin,
      "## Column BVH memory",
      s"""One memory holds three kinds of record, in sections one after the other: nodes from record 0, the triangles from
         |`scene.triangleBase`, the attributes from `scene.attributeBase`. All records are ${formats.recordBits} bits wide, the
         |widest kind rounded up to whole 32-bit words; a kind takes the low bits it needs and the others are zero. There are
         |${config.columnBvhMemory.depth} records, so that an address has ${formats.addressBits} bits, and a packed triangle id ${formats.idBits}.""".stripMargin,
      "### Node",
      """Up to four children with boxes relative to the node's corner: their planes are `origin + (low << exponent)` and
        |`origin + (high << exponent)`, in vertex units. A kind is 0 (empty), 1 (node) or 2 (leaf). Children that are nodes lie
        |at consecutive records from `firstChild`, in slot order; each that is a leaf is one triangles record, consecutive from
        |`firstTriangles`, in slot order. The root is record 0.""".stripMargin,
      table(formats.node),
      "### Triangles",
      """The triangles of a leaf. Number k has the packed id `firstTriangle + k`, and the vertices 3k, 3k + 1 and 3k + 2.
        |Packed ids follow the leaves of one binary tree, depth first, whatever the arity.""".stripMargin,
      table(formats.triangles),
      "### Attributes",
      attributes(config),
      table(formats.attributes),
      "## Physical-attribute memory",
      room(config),
      "A heap's words have 16 bits, and none is laid out further.",
      "### Tile of a two-level map",
      """Modes 0 to 3 choose between two entries of the palette, for cells of 1/2, 1/4, 1/8 or 1/16 of the tile's edge; modes 4 to
        |7 between four, for the same cells. Cells are counted row by row; cell c has bit c of the mask, or bits 2c and 2c + 1,
        |from the low bit of its first word. The mask begins at the heap word `pointer`; that of mode 0 is the low bits of
        |`pointer`. With four entries the word at `pointer` holds entries 2 (low byte) and 3, and the mask follows.""".stripMargin,
      table(new MapDescriptor),
      "### Albedo",
      "An entry of a palette: linear, all ones is 1.0.",
      table(new AlbedoEntry),
      "### Normal",
      "An entry of a palette: a unit vector in view space (x to the right, y down, z forward).",
      table(new NormalEntry),
      "### Tile of the plane map",
      """Mode 0, and 7: all of the tile lies in the plane `pointer`. Modes 1, 2 and 5: in two planes, for cells of 1/4, 1/8 or 1/16 of
        |the tile's edge; the heap word `pointer` holds their ids, the first in its low byte, and the mask follows. Modes 3, 4 and
        |6: in four planes, for the same cells; two words of ids, then the mask. Masks are as above.""".stripMargin,
      table(new PlaneDescriptor),
      "### Plane",
      """At the pixel (u, v) the inverse depth is w = (a · (u − width/2) + b · (v − height/2)) / 1024 + c, with each coefficient times
        |2^(`exponent` − 22), in a unit that the packer chooses.""".stripMargin,
      table(new Plane),
      "### Shell entry",
      "A plane beyond the view, with the one albedo and normal that it has.",
      table(new BoundingPlaneEntry),
      "## Streams",
      "### Pixel",
      "Finished pixels leave in any order.",
      table(new Pixel(config)),
      "### Load",
      "A record and its place; every column takes it.",
      table(new Load(config)),
      "## Registers",
      s"""Words of ${RegisterMap.dataBits} bits. A number starts at a word of its own, low word first. Commands, status, errors and counters have the same
         |addresses in every design; words without a register read as 0. `rw` registers hold still while a frame runs. A write of 1 to `control.start` starts a frame, and clears the errors and counters of the last one. The device takes a value above
         |its register's limit as the limit; without one, any value that fits is legal ([errors](errors.md)).""".stripMargin,
      registers(RegisterMap(config))
    )
    page.mkString("\n\n") + "\n"
  }

  private def attributes(config: ColonnadeConfig): String = {
    val slots = RecordFormats.facesPerRecord(config)
    val place =
      s"""What shading needs of a face: unit normals at the vertices and of the plane, and the index of its material. The face
         |with packed id t is in record `scene.attributeBase + t / $slots`, slot `t % $slots`.""".stripMargin
    val colours =
      if (config.geometry.cornerColours)
        "A face also has a linear colour for each vertex, where all ones is 1.0."
      else
        """With `geometry.cornerColours` a record holds one face, which also has the linear colours `colours[0]` to `colours[2]` of its
          |vertices: channels of 12 bits, where all ones is 1.0.""".stripMargin
    val textures =
      """With `geometry.textureBytes` the red and green channels of a textured face are positions u and v in the atlas, texels with 3
        |fraction bits.""".stripMargin
    s"$place\n\n$colours\n\n$textures"
  }

  private def room(config: ColonnadeConfig): String = config.physicalAttributeMemory match {
    case None =>
      """The maps of a room; this configuration has none of them (`physicalAttributeMemory` is null). Each of their parts is a
        |memory with a load target of its own, and a word takes the low bits of a load's record; the manifest's `memories` says
        |how many there are, how wide, and for which target. Tiles lie row by row.""".stripMargin
    case Some(_) =>
      val rows = AttributeMemories(config).map(m => s"| `${m.name}` | ${m.target} | ${m.depth} | ${m.bits} |")
      val head = Seq("| memory | load target | words | bits |", "|---|---|---|---|")
      s"""The maps of a room. Each of their parts is a memory with a load target of its own; a word takes the low bits of a load's
         |record. Tiles lie row by row.
         |
         |${(head ++ rows).mkString("\n")}""".stripMargin
  }

  private def table(kind: chisel3.Data): String = {
    val rows = Layout.of(kind).map { field =>
      s"| `${field.name}` | ${bits(field)} | ${field.width} | ${number(field.signed, field.fraction)} |"
    }
    ("| field | bits | width | number |" +: "|---|---|---|---|" +: rows).mkString("\n")
  }

  private def registers(all: Seq[Register]): String = {
    val rows = all.map { r =>
      val limit = r.limit.fold("")(_.toString)
      s"| ${r.address} | `${r.name}` | ${r.width} | ${number(r.signed, fraction = 0)} | $limit | ${r.access.label} |"
    }
    ("| address | register | width | number | limit | access |" +: "|---|---|---|---|---|---|" +: rows).mkString("\n")
  }

  private def bits(field: Field): String =
    if (field.width == 1) s"${field.offset}" else s"${field.end - 1}:${field.offset}"

  private def number(signed: Boolean, fraction: Int): String = {
    val kind = if (signed) "signed" else "unsigned"
    if (fraction == 0) kind else s"$kind, $fraction fraction bits"
  }
}
