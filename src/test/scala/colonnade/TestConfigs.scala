package colonnade

import colonnade.config._

/** Configurations for specs. */
object TestConfigs {

  /** One traversal unit with the formats of the presets and a small memory. */
  val tiny: ColonnadeConfig = ColonnadeConfig(
    ArrayConfig(rows = 1, columns = 1, contexts = 4),
    PrecisionConfig(mac = 32, sqrt = 32, div = 64),
    GeometryConfig(
      vertexBits = 16,
      boxBits = 7,
      triangleBits = None,
      bvh = true,
      cornerColours = false,
      textureBytes = 0
    ),
    UnitsConfig(
      boxLanes = 2,
      triangleLanes = 1,
      triangleRows = 1,
      marches = 1,
      pathContexts = 5,
      rayInterval = UnitsConfig.sequentialRayInterval,
      shadeInterval = UnitsConfig.sequentialShadeInterval,
      extraSlices = false
    ),
    ColumnBvhMemoryConfig(
      depth = 1024,
      banks = 2,
      stackDepth = 16,
      snooping = true,
      recordBuffers = 2,
      readLatency = 1,
      holdable = false,
      cache = None
    ),
    physicalAttributeMemory = None,
    FrameConfig(
      maxWidth = 640,
      maxHeight = 480,
      tileSize = 8,
      materials = 2,
      lights = 2,
      maxBounces = 3,
      hits = true,
      emission = false
    )
  )

  /** Maps of a few tiles, the last ones clipped, with a heap for some of them. */
  val environment: PhysicalAttributeMemoryConfig = PhysicalAttributeMemoryConfig(
    width = 150,
    height = 70,
    tileSize = 16,
    paletteSize = 256,
    mapBytes = 3000,
    planes = 128,
    planeBytes = 2000,
    boundingPlanes = 8,
    columnsPerCopy = 1
  )

  /** Surfaces gather light. */
  def gathering(config: ColonnadeConfig): ColonnadeConfig = config.copy(
    units = config.units.copy(shadeInterval = UnitsConfig.shadeIntervals.min),
    frame = config.frame.copy(gather = true)
  )

  def withEnvironment(environment: PhysicalAttributeMemoryConfig): ColonnadeConfig =
    tiny.copy(physicalAttributeMemory = Some(environment))

  /** Small maps, maps of the presets' size and maps of odd sizes. */
  val environments: Seq[ColonnadeConfig] = {
    val large = environment.copy(width = 640, height = 480, mapBytes = 16384, planeBytes = 12288)
    val odd   = environment.copy(
      width = 331,
      height = 97,
      tileSize = 32,
      paletteSize = 64,
      planes = 32,
      boundingPlanes = 3,
      mapBytes = 16848,
      planeBytes = 16781
    )
    Seq(environment, large, odd).map(withEnvironment)
  }

  /** The same with SLIC maps. */
  val slicEnvironments: Seq[ColonnadeConfig] =
    environments.flatMap(_.physicalAttributeMemory).map(maps => withEnvironment(maps.copy(encoding = MapEncoding.Slic)))

  /** A cache of a few lines in front of a scene of `depth` records. */
  def withCache(
      rows:    Int = 1,
      columns: Int = 1,
      banks:   Int = 2,
      sets:    Int = 2,
      ways:    Int = 2,
      misses:  Int = 2,
      depth:   Int = 256,
      bus:     Int = 32,
      parity:  Boolean = false,
      shared:  Boolean = true
  ): ColonnadeConfig = tiny.copy(
    array = tiny.array.copy(rows = rows, columns = columns),
    columnBvhMemory = tiny.columnBvhMemory.copy(
      depth = depth,
      banks = banks,
      cache = Some(SceneCacheConfig(
        lines = sets * ways * banks,
        ways = ways,
        misses = misses * banks,
        sharedLines = if (shared) 2 * sets * ways * banks else 0,
        sharedWays = if (shared) ways else 0,
        sharedMisses = 2 * misses * banks,
        busBytes = bus,
        parity = parity
      ))
    )
  )

  def withInstances(config: ColonnadeConfig, count: Int): ColonnadeConfig =
    config.copy(frame = config.frame.copy(instances = count))

  def withExtraSlices(config: ColonnadeConfig): ColonnadeConfig =
    config.copy(units = config.units.copy(extraSlices = true))

  /** With both pipelines. */
  def withPipelines(config: ColonnadeConfig): ColonnadeConfig =
    config.copy(units = config.units.copy(rayInterval = 1, shadeInterval = 3))

  def withPrecision(mac: Int, sqrt: Int, div: Int): ColonnadeConfig =
    tiny.copy(precision = PrecisionConfig(mac, sqrt, div))

  /** Formats from the narrowest to the widest, for specs that follow the model. */
  val formats: Seq[ColonnadeConfig] = Seq(
    tiny,
    withPrecision(16, 16, 16),
    withPrecision(16, 16, 32),
    withPrecision(24, 20, 40),
    withPrecision(64, 64, 64),
    tiny.copy(geometry = tiny.geometry.copy(vertexBits = 19))
  )

  /** With corner colours, from the presets' precision to the narrowest; the last one also has textures. */
  val withColours: Seq[ColonnadeConfig] =
    Seq((tiny, 0), (withPrecision(24, 24, 64), 0), (withPrecision(16, 16, 32), 16384)).map {
      case (config, textureBytes) =>
        config.copy(geometry = config.geometry.copy(cornerColours = true, textureBytes = textureBytes))
    }

  val withTextures: ColonnadeConfig = withColours.last
}
