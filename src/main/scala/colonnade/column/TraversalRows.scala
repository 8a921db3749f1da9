package colonnade.column

import chisel3._
import chisel3.experimental.hierarchy.{Definition, Instance}
import chisel3.experimental.noPrefix
import chisel3.util.{DecoupledIO, Valid}
import colonnade.config.{ColonnadeConfig, TraversalConfig}
import colonnade.formats.{Leaf, RecordBroadcast, SceneMap}
import colonnade.ray.PreparedRay
import colonnade.unit.{TraceResult, TraversalUnit}

/** The traversal units of a column, their buses and triangle units, as parts of the module that makes them. */
final private[colonnade] class TraversalRows(config: ColonnadeConfig) {

  // A definition: the unit is elaborated once, not once per row. Without prefix the instances are TraversalUnit, TraversalUnit_1…
  private val definition = Definition(new TraversalUnit(TraversalConfig(config)))

  /** By row. Their requests and events are the column's. */
  val units = Seq.fill(config.array.rows)(noPrefix(Instance(definition)).io)

  /** Traces rays; `scene` and `mask` are constant meanwhile, and `start` precedes the first one.
    *
    * @param mask of rays of applications: they hit leaves with a bit in common
    * @return what each ray has met, in any order
    */
  def connect(
      from:       DecoupledIO[PreparedRay],
      scene:      SceneMap,
      start:      Bool,
      broadcasts: Vec[Valid[RecordBroadcast]],
      mask:       Option[UInt] = None
  ): Valid[TraceResult] = noPrefix {
    val rays    = Module(new RayBus(config)).io
    val results = Module(new ResultBus(config)).io
    rays.rays :<>= from
    for ((unit, row) <- units.zipWithIndex) {
      unit.row         := row.U
      unit.scene       := scene
      unit.start       := start
      unit.rays        := rays.units(row)
      rays.isFree(row) := unit.isFree
      results.units(row) :<>= unit.results
    }
    for (rows <- units.grouped(config.units.triangleRows)) {
      val group = Module(new TriangleGroup(config, rows.size)).io
      for ((unit, row) <- rows.zipWithIndex) {
        unit.triangleLanes :<>= group.rows(row)
        for (rays <- mask; candidate = group.rows(row).candidate.bits; isMasked <- candidate.isMasked)
          isMasked       := (new Leaf(config.geometry, candidate.record).material & rays) === 0.U
        group.waits(row) := unit.waitsForTriangles
      }
    }
    units.foreach(_.broadcasts := broadcasts)
    results.results
  }
}
