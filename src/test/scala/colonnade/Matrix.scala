package colonnade

import colonnade.config.ColonnadeConfig
import org.scalatest.Tag

/** Marks a spec that `make verify` runs, and `sbt test` only with COLONNADE_MATRIX=1. */
object Matrix extends Tag("colonnade.Matrix")

/** Marks a spec that `sbt test` always runs. */
object Always extends Tag("colonnade.Always") {

  def unless(isMiddle: Boolean): Tag = if (isMiddle) Matrix else this

  /** For a spec that runs in many formats: the narrowest, the widest and that of the presets always run. */
  def ifExtreme(config: ColonnadeConfig): Tag = {
    val extremes = Seq(TestConfigs.tiny, TestConfigs.withPrecision(16, 16, 16), TestConfigs.withPrecision(64, 64, 64))
    if (extremes.exists(_.copy(physicalAttributeMemory = config.physicalAttributeMemory) == config)) Always else Matrix
  }
}
