package colonnade.config

/** Shape of the array.
  *
  * @param rows     traversal units of a column (N)
  * @param columns  columns (M)
  * @param contexts rays in flight in a traversal unit; contexts beyond those of `units` or `queries` (over all rows)
  *                 stay idle, with a note
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
  * @param mac  bits of multiply-accumulate operands
  * @param sqrt bits of a radicand
  * @param div  bits of a dividend; mantissas have half
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
  * @param vertexBits    bits of a vertex coordinate, unsigned, in the object's cube
  * @param boxBits       bits of a child box's coordinate relative to its node
  * @param triangleBits  bits of the triangle test's operands; null: as `precision.mac`
  * @param bvh           false: every ray in the object's box tests every triangle
  * @param cornerColours a face has a colour at each corner: docs/shading.md#corner-colours
  * @param textureBytes  bytes of the texture memory (docs/textures.md), from 5,314 to 21,632; 0: no textures; needs
  *                      `cornerColours`
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
  * @param boxLanes      children that a box unit tests in a cycle
  * @param triangleLanes triangle units of a group of rows: docs/traversal.md#triangle-groups
  * @param triangleRows  rows of a group; more than the column has: all
  * @param marches       environment marches of a column (docs/march.md); beyond `pathContexts` they stay idle, with a
  *                      note
  * @param pathContexts  pixels in flight in a column's path unit
  * @param rayInterval   most cycles a ray in ray set-up, while results are taken: 1 a pipeline, 32 sequential
  * @param shadeInterval most cycles of the shader for a light on a diffuse hit, while results are taken and texels come
  *                      at once: 3 a pipeline, 128 sequential
  * @param extraSlices   timing slices in traversal and caches, for FPGAs: some steps take a cycle more
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
  Require.within("units.pathContexts", pathContexts, 1, UnitsConfig.maxPathContexts)
  Require.oneOf("units.rayInterval", rayInterval, UnitsConfig.rayIntervals)
  Require.oneOf("units.shadeInterval", shadeInterval, UnitsConfig.shadeIntervals)
}

object UnitsConfig {
  val maxMarches:      Int = 16
  val maxPathContexts: Int = 256
  val maxTriangleRows: Int = 16

  /** Intervals of sequential ray set-up and of the sequential shader, which hold at all formats. */
  val sequentialRayInterval:   Int = 32
  val sequentialShadeInterval: Int = 128

  /** Legal intervals: the pipeline's, and the sequential unit's. */
  val rayIntervals:   Seq[Int] = Seq(1, sequentialRayInterval)
  val shadeIntervals: Seq[Int] = Seq(3, sequentialShadeInterval)
}

/** The memory that the units of a column share.
  *
  * @param depth         records; with a cache it only sets the width of addresses
  * @param banks         banks, interleaved by record address
  * @param stackDepth    traversal stack entries of a context
  * @param snooping      a context takes any record that the column reads
  * @param recordBuffers records that a traversal unit holds or awaits
  * @param readLatency   cycles from an accepted read to its record
  * @param holdable      an input per bank stalls it, so that verification can vary the latency at run time
  * @param cache         caches of a scene in DRAM (docs/scene-cache.md); null: a scratchpad holds the whole scene
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
  * @param maxWidth   width of the largest frame, pixels
  * @param maxHeight  height of the largest frame, pixels
  * @param tileSize   edge of a tile, pixels
  * @param materials  entries of the material table
  * @param lights     point lights
  * @param maxBounces traced reflections and refractions of a path; 0: every surface is diffuse
  * @param hits       pixels carry the hit triangle and its distance
  * @param emission   diffuse materials have an emission: docs/shading.md#colour-unit
  * @param gather     diffuse surfaces gather light (docs/gather.md); needs `maxBounces` above 0 and
  *                   `units.shadeInterval` 3
  * @param instances  objects with transforms of their own (docs/path-tracer.md#instances): 0, or at least 2; needs
  *                   `geometry.bvh`
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

/** Rays of applications.
  *
  * @param contexts rays in flight in a column
  */
final case class QueriesConfig(contexts: Int = 64) {
  Require.oneOf("queries.contexts", contexts, Seq(64, 128, 256, 512, 1024))
}

/** A whole generator configuration: immutable, checked at construction. The names, types and defaults of the parameters
  * are the keys' of its JSON, see [[ConfigIO]]. The defaults are the preset `tiny`.
  *
  * @param physicalAttributeMemory the maps of an environment; null: no environment
  * @param queries                 rays of applications in place of pixels (docs/rays.md#the-device); null: pixels;
  *                                needs `frame.maxBounces` 0, `units.rayInterval` 1, triangle tests of at most 38 bits,
  *                                directions of at most 64 bits; excludes the environment and instances
  */
final case class ColonnadeConfig(
    array:                   ArrayConfig = ArrayConfig(),
    precision:               PrecisionConfig = PrecisionConfig(),
    geometry:                GeometryConfig = GeometryConfig(),
    units:                   UnitsConfig = UnitsConfig(),
    columnBvhMemory:         ColumnBvhMemoryConfig = ColumnBvhMemoryConfig(),
    physicalAttributeMemory: Option[PhysicalAttributeMemoryConfig] = None,
    frame:                   FrameConfig = FrameConfig(),
    queries:                 Option[QueriesConfig] = None
) {
  val numbers: NumberFormats = NumberFormats(geometry, precision, frame, queries)

  Require("frame.instances", !frame.hasInstances || geometry.bvh, "needs geometry.bvh=true")
  if (queries.nonEmpty) requireForQueries()
  else {
    val hasPipeline = units.shadeInterval < UnitsConfig.sequentialShadeInterval
    Require("frame.gather", !frame.gather || frame.hasBounces, "needs frame.maxBounces=1")
    Require(
      "frame.gather",
      !frame.gather || hasPipeline,
      s"needs units.shadeInterval=${UnitsConfig.shadeIntervals.min}"
    )
  }

  /** Each rule is a setting with which it holds. */
  private def requireForQueries(): Unit = {
    val macBits = 64 - 2 - numbers.coordinateBits
    Seq(
      (!frame.hasInstances, "frame.instances=0"),
      (!frame.hasBounces, "frame.maxBounces=0"),
      (!frame.gather, "frame.gather=false"),
      (physicalAttributeMemory.isEmpty, "physicalAttributeMemory=null"),
      (units.rayInterval == 1, "units.rayInterval=1"),
      (numbers.gridBits <= 38, "geometry.triangleBits=38"),
      (precision.mac <= macBits, s"precision.mac=$macBits")
    ).foreach { case (holds, setting) => Require("queries", holds, s"needs $setting") }
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

  /** The defaults, with every optional part of a device for frames. */
  val complete: ColonnadeConfig = ColonnadeConfig(
    columnBvhMemory = ColumnBvhMemoryConfig(cache = Some(SceneCacheConfig())),
    physicalAttributeMemory = Some(PhysicalAttributeMemoryConfig()),
    units = UnitsConfig(shadeInterval = UnitsConfig.shadeIntervals.min),
    frame = FrameConfig(maxBounces = 1, gather = true)
  )
}
