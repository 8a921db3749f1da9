package colonnade.query

import colonnade.config.{ArrayConfig, ColonnadeConfig, UnitsConfig}
import colonnade.formats.{RayPlacement, RayRegisters}
import colonnade.{Model, Packed, TestConfigs}

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

  /** Small, with a short stack. */
  private def small(array: ArrayConfig): ColonnadeConfig = tiny.copy(
    array = array,
    units = tiny.units.copy(pathContexts = 64),
    columnBvhMemory = tiny.columnBvhMemory.copy(stackDepth = 8)
  )
  def ofRows(rows:       Int): ColonnadeConfig = small(ArrayConfig(rows, columns = 1, contexts = 4))
  def ofColumns(columns: Int): ColonnadeConfig = small(ArrayConfig(rows = 1, columns, contexts = 4))

  /** Of a ring of four batches. */
  val ring: BigInt = BigInt(0x8000)

  /** Registers of a device whose memory has so many records. */
  def registers(config: ColonnadeConfig, stimulus: BatchStimulus, recordCount: Int, root: Int): BigInt = {
    val scene     = stimulus.scene.registers.filter(_._1.startsWith("bounds."))
    val placement = new Packed(new RayPlacement).unpack(stimulus.placed.packed)
    new Packed(new RayRegisters(config)).pack(
      scene ++ placement.map { case (name, value) => s"placement.$name" -> value } ++ Map(
        "scene.recordCount" -> BigInt(recordCount),
        "scene.root"        -> BigInt(root),
        "ring.base"         -> ring,
        "ring.sizeLog"      -> BigInt(2)
      )
    )
  }

  /** What the model says of converted rays and hits; ray_queries.hpp has the kinds. */
  def model(config: ColonnadeConfig, kind: String, queries: Seq[Seq[BigInt]]): Seq[Seq[BigInt]] =
    Model.answers(config, queries, kind)

  /** From the presets' to those of 24-bit vertices; one has grid steps longer than a unit. */
  val formats: Seq[ColonnadeConfig] = Seq(tiny, withVertices(24, 32), withVertices(16, 18))

  def nameOf(config: ColonnadeConfig): String =
    s"${config.geometry.vertexBits}-bit vertices, ${config.numbers.gridBits}-bit triangle tests"
}
