package colonnade.column

import chisel3._
import chisel3.experimental.hierarchy.{Definition, Instance}
import chisel3.experimental.noPrefix
import chisel3.util.{DecoupledIO, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.environment.{AttributePort, MarchPort}
import colonnade.formats.{FrameRegisters, Pixel, RecordBroadcast, RecordRequest, UnitPosition}
import colonnade.shading.TexturePort
import colonnade.unit.{PathHits, PathUnit, RenderUnitModule, TraversalUnit}

/** The ports of a column's units: of its render units, or of the cluster that shares a path unit. */
private[column] final case class ColumnUnits(
    registers:  Seq[FrameRegisters],
    starts:     Seq[Bool],
    positions:  Seq[DecoupledIO[UnitPosition]],
    pixels:     Seq[DecoupledIO[Pixel]],
    requests:   Seq[DecoupledIO[RecordRequest]],
    broadcasts: Seq[Vec[Valid[RecordBroadcast]]],
    maps:       Seq[AttributePort],
    marches:    Seq[MarchPort],
    texture:    Seq[TexturePort],
    /* A pixel of a tile of the environment leaves; only of a path unit. */
    environmentLeaves: Bool,
    isIdle:            Bool,
    events:            Seq[Record]
)

private[column] object ColumnUnits {

  /** Render units that follow their own paths. */
  def separate(config: ColonnadeConfig, renderUnit: ColonnadeConfig => RenderUnitModule): ColumnUnits = {
    // A definition: the unit is elaborated once, not once per row. Without prefix the instances are RenderUnit, RenderUnit_1…
    val definition = Definition(renderUnit(config))
    val units      = Seq.fill(config.array.rows)(noPrefix(Instance(definition)).io)
    for ((unit, row) <- units.zipWithIndex) unit.row := row.U
    ColumnUnits(
      registers = units.map(_.registers),
      starts = units.map(_.start),
      positions = units.map(_.positions),
      pixels = units.map(_.pixels),
      requests = units.map(_.requests),
      broadcasts = units.map(_.broadcasts),
      maps = units.flatMap(_.maps),
      marches = units.flatMap(_.marches),
      texture = units.flatMap(_.texture),
      environmentLeaves = false.B,
      isIdle = units.map(_.isIdle).reduce(_ && _),
      events = units.map(_.events)
    )
  }

  /** A path unit, and the traversal units that trace its rays: docs/path-unit.md. {{{
    * positions ─▶ PathUnit ─ rays ─▶ PathHits ─▶ RayBus ─▶ TraversalUnit ×rows ◀─▶ records
    *    pixels ◀─┘    ▲               │  ▲  ▲                  │
    *                  └─── hits ◀─────┘  │  └── ResultBus ◀────┘
    *                                     └─▶ records (attributes)
    * }}}
    */
  def sharing(config: ColonnadeConfig): ColumnUnits = {
    val definition = Definition(new TraversalUnit(config))
    val traversals = Seq.fill(config.array.rows)(noPrefix(Instance(definition)).io)
    val paths      = Module(new PathUnit(config.ofPaths)).io
    val hits       = Module(new PathHits(config)).io
    val rays       = Module(new RayBus(config)).io
    val results    = Module(new ResultBus(config)).io
    hits.trace :<>= paths.trace
    rays.rays :<>= hits.rays
    hits.results := results.results
    for ((unit, row) <- traversals.zipWithIndex) {
      unit.row         := row.U
      unit.scene       := paths.registers.scene
      unit.rays        := rays.units(row)
      rays.isFree(row) := unit.isFree
      results.units(row) :<>= unit.results
    }
    if (config.sharesTriangleUnits) for (rows <- traversals.grouped(config.units.triangleRows)) {
      val shared = Module(new SharedTriangles(config, rows.size)).io
      for ((unit, row) <- rows.zipWithIndex) {
        unit.triangleLanes.get :<>= shared.rows(row)
        shared.waits(row) := unit.waitsForTriangles.get
      }
    }
    hits.scene := paths.registers.scene
    ColumnUnits(
      registers = Seq(paths.registers),
      starts = traversals.map(_.start) :+ hits.start,
      positions = Seq(paths.positions),
      pixels = Seq(paths.pixels),
      requests = traversals.map(_.requests) :+ hits.requests,
      broadcasts = traversals.map(_.broadcasts) :+ hits.broadcasts,
      maps = Nil,
      marches = paths.marches.toSeq,
      texture = paths.texture.toSeq,
      environmentLeaves = paths.environmentLeaves,
      isIdle = paths.isIdle,
      events = traversals.map(_.events) ++ Seq(paths.events, hits.events)
    )
  }
}
