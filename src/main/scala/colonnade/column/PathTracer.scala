package colonnade.column

import chisel3._
import chisel3.util.{Decoupled, Valid}
import colonnade.config.{ColonnadeConfig, PathConfig, TraversalConfig}
import colonnade.environment.MarchPort
import colonnade.formats.{FrameRegisters, Pixel, RecordBroadcast, RecordRequest, UnitPosition}
import colonnade.shading.{CubePort, TexturePort}
import colonnade.unit.{AttributeFetch, FetchEvents, InstanceWalk, PathEvents, PathHits, PathUnit, TraversalEvents}

/** Events of a [[PathTracer]] in one cycle. */
final class PathTracerEvents(config: ColonnadeConfig) extends Bundle {
  val traversal  = Vec(config.array.rows, new TraversalEvents(TraversalConfig(config)))
  val paths      = new PathEvents(PathConfig(config))
  val attributes = new FetchEvents(AttributeFetch.slotConfig(config))

  /** By part, with names as in `Counters`. */
  def parts: Seq[Bundle] = traversal.flatMap(unit => Seq(unit.intersector, unit.fetch)) ++ Seq(paths, attributes)
}

/** `registers` is constant while a frame runs; `start` precedes the first position. */
final class PathTracerIO(config: ColonnadeConfig) extends Bundle {
  val registers = Input(new FrameRegisters(config))
  val start     = Input(Bool())
  val positions = Flipped(Decoupled(new UnitPosition(config)))
  val pixels    = Decoupled(new Pixel(config)) // in any order

  /** To the column's records: of each traversal unit, and of the path unit for attributes. */
  val requests   = Vec(config.recordRequesters, Decoupled(new RecordRequest(config)))
  val broadcasts = Flipped(Vec(config.columnBvhMemory.banks, Valid(new RecordBroadcast(config))))

  /** To the marches of the environment, and to the textures. */
  val marches = Option.when(config.hasEnvironment)(new MarchPort(PathConfig(config)))
  val texture = config.geometry.texture.map(_ => new TexturePort(PathConfig(config)))

  /** To the light cube. */
  val cube = CubePort(config)

  /** A pixel of a tile of the environment leaves; no pixel is in flight, and no request waits. */
  val environmentLeaves = Output(Bool())
  val isIdle            = Output(Bool())
  val events            = Output(new PathTracerEvents(config))
}

/** A module with the ports of a path tracer: [[PathTracer]], or what specs put in its place. */
abstract class PathTracerModule(config: ColonnadeConfig) extends Module {
  final val io: PathTracerIO = IO(new PathTracerIO(config))
}

/** Turns pixel positions into pixels: a path unit, and the traversal units that trace its rays: docs/path-tracer.md. */
final class PathTracer(config: ColonnadeConfig) extends PathTracerModule(config) {
  private val pathConfig = PathConfig(config)

  private val rows  = new TraversalRows(config)
  private val paths = Module(new PathUnit(pathConfig)).io
  private val hits  = Module(new PathHits(pathConfig)).io
  private val scene = io.registers.scene

  // Pixels
  paths.registers := io.registers
  paths.positions :<>= io.positions
  io.pixels :<>= paths.pixels
  io.marches.zip(paths.marches).foreach { case (port, marches) => port :<>= marches }
  io.texture.zip(paths.texture).foreach { case (port, texture) => port :<>= texture }
  io.cube.zip(paths.cube).foreach { case (port, cube) => port :<>= cube }
  io.environmentLeaves := paths.environmentLeaves

  // Rays and their results
  hits.trace :<>= paths.trace
  if (config.frame.hasInstances) {
    val walk = Module(new InstanceWalk(pathConfig)).io
    walk.scene     := scene
    walk.instances := io.registers.instances.get
    walk.rays :<>= hits.rays
    hits.visits.get :<>= walk.requests
    hits.worldRays.get :<>= walk.worldRays
    walk.objectResults := rows.connect(walk.objectRays, scene, io.start, io.broadcasts)
    hits.results       := walk.results
    hits.instances.get := io.registers.instances.get
  } else hits.results := rows.connect(hits.rays, scene, io.start, io.broadcasts)

  // Records
  hits.start := io.start
  hits.scene := scene
  for ((port, requests) <- io.requests.zip(rows.units.map(_.requests) :+ hits.requests)) port :<>= requests
  hits.broadcasts := io.broadcasts
  for ((wants, material) <- hits.wantsColours.toSeq.flatten.zip(io.registers.materials))
    wants := material.hasCornerColours.getOrElse(false.B) || material.hasTexture.getOrElse(false.B)

  io.isIdle := paths.isIdle && !io.requests.map(_.valid).reduce(_ || _)
  for ((events, unit) <- io.events.traversal.zip(rows.units)) events := unit.events
  io.events.paths                                                    := paths.events
  io.events.attributes                                               := hits.events
}
