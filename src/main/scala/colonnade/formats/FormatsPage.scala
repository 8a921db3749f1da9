package colonnade.formats

import colonnade.config.ColonnadeConfig

/** The memory formats of a configuration as a Markdown page, from the same definitions as the manifest. */
object FormatsPage {

  def apply(config: ColonnadeConfig): String = {
    val formats = new RecordFormats(config)
    val kinds   = formats.kinds.toMap

    def body(format: String) = table(numbersOf(kinds(format)).filter(_._1.startsWith("body.")))
    val page                 = Seq(
      "# Memory formats",
      s"""*Written by the generator (`tools/regenerate`) from the Chisel bundles of `colonnade.formats`, for preset `small`, precision
         |${config.precision}. Widths follow the configuration.*""".stripMargin,
      """`u16` is an unsigned number of 16 bits; `s12.11` is signed, 12 bits, 11 of them fraction bits. Bit 0 is the least significant.
        |One row holds fields of one kind: of `normals[i<3].xyz` at `68+36i`, `56+36i`, `44+36i`, `normals[2].z` is at 44 + 36 · 2.""".stripMargin,
      "## Column BVH memory",
      s"""One memory holds nodes and leaves. All records have ${formats.recordBits} bits, whole words of 32; unused high bits are zero. There
         |are ${config.columnBvhMemory.depth} records: an address has ${formats.addressBits} bits, a packed triangle id ${formats.idBits}.""".stripMargin,
      "### Node",
      """Up to four children, at consecutive records from `first`: as many `nodes`, then as many `leaves`. Their boxes have planes
        |`origin + (low << exponent)` and `origin + (high << exponent)`, in vertex units. `corner` is 2 · origin + 2^exponent: its
        |lowest set bit gives the exponent, of which the origin is a multiple. The root is at `scene.root`.""".stripMargin,
      table(formats.node),
      "### Leaf",
      """A pair of triangles with a common edge, or one triangle. The triangles of the leaf at address a have packed ids 2a and
        |2a + 1, and vertices (0, 1, 2) and (1, 0, 3). Any bits are legal. All formats have these fields:""".stripMargin,
      table(numbersOf(kinds("nearPair")).filterNot(_._1.matches("body.*|unused"))),
      """The format is 0 for a near pair, 1 for a triangle, 2 for a flat pair, 3 for a far pair. A corner normal is a
        |[code](numbers.md#normals) (u, v).""".stripMargin,
      "Near pair: vertices 1 to 3 are vertex 0 plus a delta, and wrap. Each code lies in two parts, with its lowest bits apart:",
      body("nearPair"),
      "Far pair: the deltas of a near pair, with a sign in place of the lowest bits of codes, which are 0:",
      body("farPair"),
      "Flat pair, with the corner normals of its triangles; and one triangle:",
      body("flatPair"),
      body("triangle"),
      "### Colours",
      """With `geometry.cornerColours` and `scene.hasColours` the record after each leaf is its companion: `colours[i<4].rgb` of its
        |vertices, 12 bits each, all ones 1.0. With `geometry.textureBytes` red and green of a textured face are u and v in the atlas,
        |texels with 3 fraction bits.""".stripMargin,
      "## Physical-attribute memory",
      attributeMemories(config),
      "`mapDescriptor`, a tile of the albedo or normal map ([modes and masks](background.md#twolevel)):",
      table(new MapDescriptor),
      "`albedo` of a palette or a SLIC seed, linear, all ones 1.0:",
      table(new AlbedoEntry),
      "`normal` of a palette or a SLIC seed, a unit vector in view space (x right, y down, z forward):",
      table(new NormalEntry),
      "`planeDescriptor`, a tile of the [plane map](background.md#planes):",
      table(new PlaneDescriptor),
      "`plane`:",
      table(new Plane),
      "`boundingPlaneEntry`, with its albedo and normal:",
      table(new BoundingPlaneEntry),
      "## Streams",
      "Finished pixels leave in any order:",
      table(new Pixel(config)),
      "A load is a record and its address; every column takes it:",
      table(new Load(config)),
      "## Registers",
      s"""Words of ${RegisterMap.dataBits} bits. A number starts at a word of its own, low word first. Commands, status, errors and counters have the
         |same addresses in every design. Words without a register read as 0. A write of 1 to `control.start` clears errors and
         |counters, and starts a frame, during which registers hold still. A value above the limit (`to` …) counts as the limit
         |([errors](errors.md)).""".stripMargin,
      registers(config)
    )
    page.mkString("\n\n") + "\n"
  }

  private def attributeMemories(config: ColonnadeConfig): String = config.physicalAttributeMemory match {
    case None =>
      """The maps of an environment; this configuration has none of them (`physicalAttributeMemory` is null). Each of their parts is a
        |memory with a load target of its own, and a word takes the low bits of a load's record; the manifest's `memories` says
        |how many there are, how wide, and for which target. Tiles lie row by row.""".stripMargin
    case Some(_) =>
      val rows = AttributeMemories(config).map(m => s"|`${m.name}`|${m.target}|${m.depth}|${m.bits}|")
      val head = Seq("|memory|load target|words|bits|", "|---|---|---|---|")
      """The maps of an environment. Each of their parts is a memory with a load target of its own; a word takes the low bits of a load's
        |record. Tiles lie row by row.""".stripMargin + (head ++ rows).mkString("\n\n", "\n", "")
  }

  private def table(kind: chisel3.Data): String = table(numbersOf(kind))

  private def table(numbers: Seq[(String, Int, String)]): String =
    table("field|low bit|number", FieldFamily.of(numbers))

  private def numbersOf(kind: chisel3.Data): Seq[(String, Int, String)] =
    Layout.of(kind).map(f => (f.name, f.offset, number(f.width, f.signed, f.fraction)))

  private val titles =
    Map[Access, String](
      Access.WriteOnly -> "Write only",
      Access.ReadOnly  -> "Read only",
      Access.ReadWrite -> "Read and write"
    )

  private def registers(config: ColonnadeConfig): String = {
    val all   = RegisterMap(config)
    val parts = all.map(_.access).distinct.map { access =>
      val numbers = all.filter(_.access == access).map { r =>
        (r.name, r.address, number(r.width, r.signed, 0) + r.limit.fold("")(limit => s", to $limit"))
      }
      s"${titles(access)}:\n\n${table("register|address|number", FieldFamily.of(numbers))}"
    }
    parts.mkString("\n\n")
  }

  private def table(head: String, families: Seq[FieldFamily]): String = {
    val rows = families.map(family => s"`${family.pattern}`|${family.positions}|${family.kind}")
    (head +: "---|---|---" +: rows).map(row => s"|$row|").mkString("\n")
  }

  private def number(width: Int, signed: Boolean, fraction: Int): String = {
    val kind = if (signed) "s" else "u"
    if (fraction == 0) s"$kind$width" else s"$kind$width.$fraction"
  }
}
