package colonnade

import colonnade.config._

/** Configurations for specs. */
object TestConfigs {

  /** One render unit of the presets' formats, with a small memory. */
  val tiny: ColonnadeConfig = ColonnadeConfig(
    ArrayConfig(rows = 1, columns = 1, contexts = 4),
    PrecisionConfig(mac = 32, sqrt = 32, div = 64),
    GeometryConfig(vertexBits = 16, boxBits = 8, triangleBits = None, arity = 4, trianglesPerRecord = 2, bvh = true),
    UnitsConfig(boxLanes = 2, triangleLanes = 1),
    ColumnBvhMemoryConfig(
      depth = 1024,
      banks = 2,
      stackDepth = 16,
      snooping = true,
      recordBuffers = 2,
      readLatency = 1,
      holdable = false
    ),
    physicalAttributeMemory = None,
    FrameConfig(maxWidth = 640, maxHeight = 480, tileSize = 8, materials = 2, hits = true)
  )

  def withPrecision(mac: Int, sqrt: Int, div: Int): ColonnadeConfig =
    tiny.copy(precision = PrecisionConfig(mac, sqrt, div))

  /** Formats from the narrowest to the widest, for specs that follow the model. */
  val formats: Seq[ColonnadeConfig] = Seq(
    tiny,
    withPrecision(16, 16, 16),
    withPrecision(16, 16, 32),
    withPrecision(24, 20, 40),
    withPrecision(64, 64, 64),
    tiny.copy(geometry = tiny.geometry.copy(vertexBits = 20))
  )
}
