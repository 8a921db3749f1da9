package colonnade.query

import colonnade.TestConfigs
import colonnade.config.{ColonnadeConfig, UnitsConfig}

/** Designs for rays of applications. */
object RayConfigs {

  /** One traversal unit, with the formats of the presets. */
  val tiny: ColonnadeConfig = {
    val base = TestConfigs.tiny
    base.copy(
      geometry = base.geometry.copy(triangleBits = Some(24)),
      units = base.units.copy(rayInterval = UnitsConfig.rayIntervals.min, pathContexts = 256),
      frame = base.frame.copy(maxBounces = 0, rays = true)
    )
  }

  def withVertices(vertexBits: Int, triangleBits: Int): ColonnadeConfig =
    tiny.copy(geometry = tiny.geometry.copy(vertexBits = vertexBits, triangleBits = Some(triangleBits)))

  /** From the presets' to those of 24-bit vertices; one has grid steps longer than a unit. */
  val formats: Seq[ColonnadeConfig] = Seq(tiny, withVertices(24, 32), withVertices(16, 18))

  def nameOf(config: ColonnadeConfig): String =
    s"${config.geometry.vertexBits}-bit vertices, ${config.numbers.gridBits}-bit triangle tests"
}
