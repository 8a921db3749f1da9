package colonnade.unit

import chisel3._
import colonnade.config.ColonnadeConfig

/** A render unit that follows its own paths and traces their rays, with one ray in flight per context: {{{
  *
  * positions ─▶ PathUnit ─▶ rays ─▶ Intersector ◀─▶ FetchStage ◀─▶ column (requests, broadcasts)
  *     pixels ◀─┘    ▲                                  │
  *                   └──────── hits with attributes ◀───┘
  * }}}
  */
final class RenderUnit(config: ColonnadeConfig) extends RenderUnitModule(config) {
  private val paths       = Module(new PathUnit(config)).io
  private val fetch       = Module(new FetchStage(config)).io
  private val intersector = Module(new Intersector(config)).io
  private val trace       = paths.trace

  // Paths
  paths.registers := io.registers
  paths.positions :<>= io.positions
  io.pixels :<>= paths.pixels
  io.texture.zip(paths.texture).foreach { case (port, texture) => port <> texture }
  io.maps.zip(paths.maps).foreach { case (port, maps) => port <> maps }
  io.marches.zip(paths.marches).foreach { case (port, marches) => port :<>= marches }
  io.isIdle := paths.isIdle && fetch.isIdle.getOrElse(true.B)

  // Intersection: each record comes with the ray of its context
  trace.control :<>= intersector.control
  intersector.rays :<>= trace.rays
  io.requests :<>= fetch.requests
  fetch.broadcasts := io.broadcasts
  fetch.ray        := intersector.entered
  fetch.fetches    := intersector.fetches
  fetch.readyNext  := VecInit(intersector.nodesReadyNext, intersector.trianglesReadyNext, trace.hitsReadyNext)
  intersector.nodes :<>= fetch.nodes
  intersector.triangles :<>= fetch.triangles
  intersector.closestHit :<>= fetch.closestHit
  intersector.fetchError := fetch.traversalError

  // Hits
  trace.hits :<>= fetch.hits
  trace.hasSurface     := intersector.hasSurface
  trace.surfaceHit     := intersector.surfaceHit
  trace.attributeError := fetch.attributeError

  // Registers and events
  fetch.start       := io.start
  fetch.row         := io.row
  fetch.scene       := io.registers.scene
  intersector.start := io.start
  intersector.scene := io.registers.scene
  io.events         := UnitCounters(config, Some(paths.events), intersector, fetch)
}
