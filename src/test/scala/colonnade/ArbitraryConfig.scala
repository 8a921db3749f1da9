package colonnade

import colonnade.config._
import org.scalacheck.Gen

/** Random legal configurations. */
object ArbitraryConfig {
  private val flag = Gen.oneOf(true, false)

  val precision: Gen[PrecisionConfig] =
    Gen.zip(width, width, width).map { case (mac, sqrt, div) => PrecisionConfig(mac, sqrt, div) }

  private def width: Gen[Int] = Gen.chooseNum(16, 64, 17, 32, 63)

  private val array = for {
    rows     <- Gen.chooseNum(1, ArrayConfig.maxRows)
    columns  <- Gen.chooseNum(1, ArrayConfig.maxColumns)
    contexts <- Gen.chooseNum(1, ArrayConfig.maxContexts)
  } yield ArrayConfig(rows, columns, contexts)

  private val geometry = for {
    vertexBits    <- Gen.chooseNum(10, 19)
    boxBits       <- Gen.chooseNum(4, 7)
    triangleBits  <- Gen.option(width)
    bvh           <- flag
    cornerColours <- flag
    textureBytes  <- Gen.oneOf(Seq(0) ++ (if (cornerColours) Seq(5314, 16384, 21632) else Nil))
  } yield GeometryConfig(vertexBits, boxBits, triangleBits, bvh, cornerColours, textureBytes)

  private val units = for {
    boxLanes      <- Gen.oneOf(1, 2, 4)
    triangleLanes <- Gen.chooseNum(1, 4)
    triangleRows  <- Gen.chooseNum(1, UnitsConfig.maxTriangleRows)
    marches       <- Gen.chooseNum(1, UnitsConfig.maxMarches)
    pathContexts  <- Gen.chooseNum(1, UnitsConfig.maxPathContexts)
    rayInterval   <- Gen.oneOf(UnitsConfig.rayIntervals)
    shadeInterval <- Gen.oneOf(UnitsConfig.shadeIntervals)
    extraSlices   <- flag
  } yield UnitsConfig(
    boxLanes,
    triangleLanes,
    triangleRows,
    marches,
    pathContexts,
    rayInterval,
    shadeInterval,
    extraSlices
  )

  private val memory = for {
    depth         <- Gen.chooseNum(16, 1 << 22, 17, 1024, 1 << 17)
    banks         <- Gen.oneOf(1, 2, 4)
    stackDepth    <- Gen.chooseNum(4, 256)
    snooping      <- flag
    recordBuffers <- Gen.chooseNum(1, 8)
    readLatency   <- Gen.chooseNum(1, 16)
    holdable      <- flag
    cache         <- Gen.option(sceneCache(banks))
  } yield
    if (cache.isEmpty)
      ColumnBvhMemoryConfig(depth, banks, stackDepth, snooping, recordBuffers, readLatency, holdable, None)
    else ColumnBvhMemoryConfig(
      depth.max(SceneCacheConfig.leastDepth),
      banks,
      stackDepth,
      true,
      recordBuffers,
      1,
      false,
      cache
    )

  private def sceneCache(banks: Int) = for {
    sets         <- Gen.oneOf(1, 2, 16)
    ways         <- Gen.oneOf(1, 2, 4, 8)
    misses       <- Gen.chooseNum(1, 4)
    sharedSets   <- Gen.oneOf(1, 4, 32)
    sharedWays   <- Gen.oneOf(1, 2, 8)
    sharedMisses <- Gen.chooseNum(1, 16)
    busBytes     <- Gen.oneOf(4, 8, 16, 32, 64, 128)
    parity       <- Gen.oneOf(true, false)
    shared = if (busBytes == 4) sharedSets % 2 else 1
  } yield SceneCacheConfig(
    sets * ways * banks,
    ways,
    misses * banks,
    shared * sharedSets * sharedWays * banks,
    shared * sharedWays,
    sharedMisses * banks,
    busBytes,
    parity
  )

  /** Maps with a legal size: at least their fixed parts, at most the reach of pointers. */
  private val physicalAttributeMemory = for {
    width          <- Gen.chooseNum(64, 1000, 640)
    height         <- Gen.chooseNum(64, 1000, 480)
    encoding       <- Gen.oneOf(MapEncoding.all)
    tileSize       <- Gen.oneOf(16, 32)
    paletteSize    <- Gen.oneOf(16, 64, 256)
    planes         <- Gen.oneOf(16, 128, 256)
    boundingPlanes <- Gen.chooseNum(2, 16)
    mapHeap        <- Gen.chooseNum(66, 16384)
    planeHeap      <- Gen.chooseNum(68, 16384)
    columnsPerCopy <- Gen.chooseNum(1, 4)
  } yield {
    def parts(size: Int, edge: Int) = (size + edge - 1) / edge
    val tiles                       = parts(width, tileSize) * parts(height, tileSize)
    val mapBytes                    = encoding match {
      case MapEncoding.TwoLevel => tiles * 4 + paletteSize * 9 / 2 + mapHeap
      case MapEncoding.Slic     =>
        (tiles * 9 + 1) / 2 + (parts(width, tileSize / 4) * parts(height, tileSize / 4) + 3) / 4 * 2 + mapHeap
    }
    val planeBytes = tiles * 2 + planes * 8 + boundingPlanes * 18 + planeHeap
    PhysicalAttributeMemoryConfig(
      width,
      height,
      encoding,
      tileSize,
      paletteSize,
      mapBytes,
      planes,
      planeBytes,
      boundingPlanes,
      columnsPerCopy
    )
  }

  private val frame = for {
    maxWidth   <- Gen.chooseNum(8, 4096)
    maxHeight  <- Gen.chooseNum(8, 4096)
    tileSize   <- Gen.oneOf(4, 8, 16, 32)
    materials  <- Gen.chooseNum(1, 256)
    lights     <- Gen.chooseNum(1, 8)
    maxBounces <- Gen.chooseNum(0, 15)
    hits       <- flag
    emission   <- flag
    gather     <- flag
  } yield FrameConfig(
    maxWidth,
    maxHeight,
    tileSize,
    materials,
    lights,
    maxBounces,
    hits,
    emission,
    gather && maxBounces > 0
  )

  val legal: Gen[ColonnadeConfig] = for {
    array     <- array
    precision <- precision
    geometry  <- geometry
    units     <- units
    memory    <- memory
    maps      <- Gen.option(physicalAttributeMemory)
    frame     <- frame
  } yield {
    val gathers = frame.gather && units.shadeInterval < UnitsConfig.sequentialShadeInterval
    ColonnadeConfig(array, precision, geometry, units, memory, maps, frame.copy(gather = gathers))
  }
}
