package colonnade.config

import chisel3.util.log2Ceil

/** Shape of the array.
  *
  * @param rows     traversal units that share one column memory (N)
  * @param columns  columns side by side (M)
  * @param contexts rays in flight in each traversal unit
  */
final case class ArrayConfig(rows: Int = 1, columns: Int = 1, contexts: Int = 8) {
  Require.within("array.rows", rows, 1, ArrayConfig.maxRows)
  Require.within("array.columns", columns, 1, ArrayConfig.maxColumns)
  Require.within("array.contexts", contexts, 1, ArrayConfig.maxContexts)
}

object ArrayConfig {

  /** Maximum number of contexts of a traversal unit; a path unit may have more. */
  val maxContexts: Int = 16
  val maxRows:     Int = 256
  val maxColumns:  Int = 256
}

/** Operand widths, the paper's mixed precision: `32b32s64d` is mac 32, sqrt 32, div 64.
  *
  * @param mac  multiply-accumulate operands
  * @param sqrt radicand of the square root
  * @param div  dividend of a division
  */
final case class PrecisionConfig(mac: Int = 32, sqrt: Int = 32, div: Int = 64) {
  Require.within("precision.mac", mac, 16, 64)
  Require.within("precision.sqrt", sqrt, 16, 64)
  Require.within("precision.div", div, 16, 64)

  override def toString: String = s"${mac}b${sqrt}s${div}d"
}

object PrecisionConfig {
  private val notation = """(\d{1,6})b(\d{1,6})s(\d{1,6})d""".r

  /** A precision in the paper's notation. */
  def unapply(text: String): Option[PrecisionConfig] = PartialFunction.condOpt(text) {
    case notation(mac, sqrt, div) => PrecisionConfig(mac.toInt, sqrt.toInt, div.toInt)
  }
}

/** Geometry records and the acceleration structure.
  *
  * @param vertexBits         a vertex coordinate, unsigned, in the object's cube
  * @param boxBits            a child box's coordinate relative to its node
  * @param triangleBits       operands of the triangle test; `precision.mac` unless set
  * @param bvh                false: every ray tests every triangle (the exhaustive baseline)
  * @param cornerColours      a face holds a colour for each corner, and a material may take its albedo from them
  * @param textureBytes       of the texture memory; with one, a material may take the colours of the corners as positions
  *                           in it; 0: no textures
  */
final case class GeometryConfig(
    vertexBits:    Int = 16,
    boxBits:       Int = 7,
    triangleBits:  Option[Int] = Some(24),
    bvh:           Boolean = true,
    cornerColours: Boolean = false,
    textureBytes:  Int = 0
) {
  Require.within("geometry.vertexBits", vertexBits, 10, 24)
  Require.within("geometry.boxBits", boxBits, 4, 7)
  triangleBits.foreach(Require.within("geometry.triangleBits", _, 16, 64))
  Require("geometry.textureBytes", textureBytes == 0 || cornerColours, "needs geometry.cornerColours=true")

  /** The texture memory, if there is one. */
  val texture: Option[TextureLayout] = Option.when(textureBytes != 0)(TextureLayout(textureBytes))
}

/** Units of a column.
  *
  * @param boxLanes      children that the box unit tests per cycle
  * @param triangleLanes parallel triangle units of a group of rows
  * @param triangleRows  rows of a column in a group, which shares its triangle units
  * @param marches       environment marches of a column, if the device supports an environment
  * @param pathContexts  pixels in flight in a column's path unit; with frame.rays: its rays, a power of two from 64 on
  * @param rayInterval   most cycles between rays that ray set-up takes, while the rays that it has prepared are taken: 1
  *                      chooses a pipeline, 32 one ray after the other
  * @param shadeInterval most cycles of the shader for a light on a diffuse hit, while what it has shaded is taken and
  *                      texels come at once: 3 chooses a pipeline, 128 one hit after the other. Hits on mirrors and
  *                      glass take the time of their bounce units
  * @param extraSlices   the optional timing slices of traversal and caches, for FPGAs: some steps take a cycle more
  */
final case class UnitsConfig(
    boxLanes:      Int = 2,
    triangleLanes: Int = 1,
    triangleRows:  Int = 1,
    marches:       Int = 1,
    pathContexts:  Int = 8,
    rayInterval:   Int = UnitsConfig.sequentialRayInterval,
    shadeInterval: Int = UnitsConfig.sequentialShadeInterval,
    extraSlices:   Boolean = false
) {
  Require.oneOf("units.boxLanes", boxLanes, Seq(1, 2, 4))
  Require.within("units.triangleLanes", triangleLanes, 1, 4)
  Require.within("units.triangleRows", triangleRows, 1, UnitsConfig.maxTriangleRows)
  Require.within("units.marches", marches, 1, UnitsConfig.maxMarches)
  Require.within("units.pathContexts", pathContexts, 1, UnitsConfig.maxRayContexts)
  Require.oneOf("units.rayInterval", rayInterval, UnitsConfig.rayIntervals)
  Require.oneOf("units.shadeInterval", shadeInterval, UnitsConfig.shadeIntervals)
}

object UnitsConfig {
  val maxMarches:      Int = 16
  val maxPathContexts: Int = 256
  val maxRayContexts:  Int = 1024
  val maxTriangleRows: Int = 16

  /** Intervals of sequential ray set-up and of the sequential shader, which hold at all formats. */
  val sequentialRayInterval:   Int = 32
  val sequentialShadeInterval: Int = 128

  /** Legal intervals: those of the pipeline and of the sequential unit. */
  val rayIntervals:   Seq[Int] = Seq(1, sequentialRayInterval)
  val shadeIntervals: Seq[Int] = Seq(3, sequentialShadeInterval)
}

/** The memory that the units of a column share.
  *
  * @param depth         records
  * @param banks         independent banks, interleaved by record address
  * @param stackDepth    traversal stack entries of each context
  * @param snooping      a context gets its record from the read of any unit of the column
  * @param recordBuffers record buffers of a traversal unit
  * @param readLatency   cycles from an accepted read to its record
  * @param holdable      an input per bank that stalls it, so that verification can vary the latency at run time
  * @param cache         the memory is a cache of records in DRAM; none: a scratchpad that holds the whole scene
  */
final case class ColumnBvhMemoryConfig(
    depth:         Int = 131072,
    banks:         Int = 2,
    stackDepth:    Int = 32,
    snooping:      Boolean = true,
    recordBuffers: Int = 2,
    readLatency:   Int = 1,
    holdable:      Boolean = false,
    cache:         Option[SceneCacheConfig] = None
) {
  Require.within("columnBvhMemory.depth", depth, 16, 1 << 22)
  Require.oneOf("columnBvhMemory.banks", banks, Seq(1, 2, 4))
  Require.within("columnBvhMemory.stackDepth", stackDepth, 4, 256)
  Require.within("columnBvhMemory.recordBuffers", recordBuffers, 1, 8)
  Require.within("columnBvhMemory.readLatency", readLatency, 1, 16)
  cache.foreach(each => Require.ifSound(each.check(this)))
}

/** Limits of a frame.
  *
  * @param maxWidth   widest frame, pixels
  * @param maxHeight  highest frame, pixels
  * @param tileSize   edge of the square tiles that are dispatched to columns, pixels
  * @param materials  entries of the material table
  * @param lights     point lights
  * @param maxBounces reflections and refractions of a path that are traced; 0: every material is diffuse
  * @param hits       the pixel stream also carries the hit triangle and its distance
  * @param emission   materials have a colour that diffuse surfaces emit
  * @param gather     diffuse surfaces gather light: docs/gather.md
  * @param rays       rays of applications and their hits in place of pixels: docs/rays.md
  * @param instances  objects with a transform of their own: docs/path-tracer.md; 0: none
  */
final case class FrameConfig(
    maxWidth:   Int = 1920,
    maxHeight:  Int = 1080,
    tileSize:   Int = 16,
    materials:  Int = 8,
    lights:     Int = 1,
    maxBounces: Int = 0,
    hits:       Boolean = true,
    emission:   Boolean = false,
    gather:     Boolean = false,
    rays:       Boolean = false,
    instances:  Int = 0
) {
  Require.within("frame.maxWidth", maxWidth, 8, 4096)
  Require.within("frame.maxHeight", maxHeight, 8, 4096)
  Require.oneOf("frame.tileSize", tileSize, Seq(4, 8, 16, 32))
  Require.within("frame.materials", materials, 1, 256)
  Require.within("frame.lights", lights, 1, 8)
  Require.within("frame.maxBounces", maxBounces, 0, 15)
  Require.within("frame.instances", instances, 0, FrameConfig.maxInstances)
  Require("frame.instances", instances != 1, "is 0 or at least 2: one object moves by the registers of the camera")

  /** The device supports mirrors and glass. */
  val hasBounces: Boolean = maxBounces > 0

  /** Objects have transforms of their own. */
  val hasInstances: Boolean = instances > 0
}

object FrameConfig {
  val maxInstances: Int = 16
}

/** A whole generator configuration: immutable, checked at construction. The names, types and defaults of the parameters
  * are those of the keys of its JSON, see [[ConfigIO]]. The defaults are the preset `tiny`.
  *
  * @param physicalAttributeMemory none for a device without an environment
  */
final case class ColonnadeConfig(
    array:                   ArrayConfig = ArrayConfig(),
    precision:               PrecisionConfig = PrecisionConfig(),
    geometry:                GeometryConfig = GeometryConfig(),
    units:                   UnitsConfig = UnitsConfig(),
    columnBvhMemory:         ColumnBvhMemoryConfig = ColumnBvhMemoryConfig(),
    physicalAttributeMemory: Option[PhysicalAttributeMemoryConfig] = None,
    frame:                   FrameConfig = FrameConfig()
) {
  val numbers: NumberFormats = NumberFormats(geometry, precision, frame)

  Require("frame.instances", !frame.hasInstances || geometry.bvh, "needs geometry.bvh=true")
  if (frame.rays) requireForRays()
  else {
    val hasPipeline = units.shadeInterval < UnitsConfig.sequentialShadeInterval
    Require("frame.gather", !frame.gather || frame.hasBounces, "needs frame.maxBounces=1")
    Require(
      "frame.gather",
      !frame.gather || hasPipeline,
      s"needs units.shadeInterval=${UnitsConfig.shadeIntervals.min}"
    )
    Require(
      "units.pathContexts",
      units.pathContexts <= UnitsConfig.maxPathContexts,
      s"must be at most ${UnitsConfig.maxPathContexts} without frame.rays"
    )
  }

  /** Each rule is a setting with which it holds. */
  private def requireForRays(): Unit = {
    val contexts = (1 << log2Ceil(units.pathContexts)).max(64)
    val macBits  = 64 - 2 - numbers.coordinateBits
    Seq(
      (!frame.hasInstances, "frame.instances=0"),
      (!frame.hasBounces, "frame.maxBounces=0"),
      (!frame.gather, "frame.gather=false"),
      (physicalAttributeMemory.isEmpty, "physicalAttributeMemory=null"),
      (units.rayInterval == 1, "units.rayInterval=1"),
      (units.pathContexts == contexts, s"units.pathContexts=$contexts"),
      (numbers.gridBits <= 38, "geometry.triangleBits=38"),
      (precision.mac <= macBits, s"precision.mac=$macBits")
    ).foreach { case (holds, setting) => Require("frame.rays", holds, s"needs $setting") }
  }

  /** Rows share triangle units. */
  val sharesTriangleUnits: Boolean = units.triangleRows > 1

  /** Requesters of a column's records: its rows, and the path unit for attributes. */
  val recordRequesters: Int = array.rows + 1

  /** The device supports an environment. */
  val hasEnvironment: Boolean = physicalAttributeMemory.nonEmpty

  /** Points of the environment gather light from the object. */
  val gathersInRoom: Boolean = frame.gather && hasEnvironment

  /** Columns that read one copy of the environment's maps. */
  val columnsPerCopy: Int = physicalAttributeMemory.fold(1)(_.columnsPerCopy.min(array.columns))

  /** Ports to a column's maps of an environment: of its marches, and of the pipeline for directly seen pixels. */
  val mapRequesters: Int = units.marches + 1
}

object ColonnadeConfig {

  /** The defaults, with every optional part. */
  val complete: ColonnadeConfig = ColonnadeConfig(
    columnBvhMemory = ColumnBvhMemoryConfig(cache = Some(SceneCacheConfig())),
    physicalAttributeMemory = Some(PhysicalAttributeMemoryConfig()),
    units = UnitsConfig(shadeInterval = UnitsConfig.shadeIntervals.min),
    frame = FrameConfig(maxBounces = 1, gather = true)
  )
}
