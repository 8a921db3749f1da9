package colonnade.column

import chisel3._
import chisel3.experimental.hierarchy.{instantiable, public}
import chisel3.util.{Decoupled, Valid}
import colonnade.config.{ColonnadeConfig, PathConfig}
import colonnade.environment.{AttributePort, ColumnEnvironment, EnvironmentMarches}
import colonnade.formats.{FrameRegisters, Load, Pixel}
import colonnade.frame.{
  BackgroundWalker,
  ColumnProgress,
  ColumnTiles,
  EnvironmentWalker,
  EnvironmentWindow,
  EventSums,
  PixelCollector,
  TileWalker
}
import colonnade.memory.{ColumnBvhMemory, ColumnCache, LineBroadcast, Lines}
import colonnade.shading.{CubePort, TexturePort}

final class ColumnIO(config: ColonnadeConfig) extends Bundle {
  private val banks = config.columnBvhMemory.banks

  val registers = Input(new FrameRegisters(config)) // constant while a frame runs

  /** A frame starts, before its first tile. A load comes only while idle. */
  val start = Input(Bool())
  val load  = Flipped(Valid(new Load(config)))

  /** See [[colonnade.memory.ColumnBvhMemoryIO]]. */
  val holds = if (config.columnBvhMemory.holdable) Some(Input(UInt(config.columnBvhMemory.banks.W))) else None

  /** With a cache, by bank: lines that are awaited, and lines that come. */
  val lineRequests = config.columnBvhMemory.cache.map(_ => Vec(banks, Decoupled(UInt(Lines.lineBits(config).W))))
  val lines        = config.columnBvhMemory.cache.map(_ => Input(Vec(banks, new LineBroadcast(config))))

  /** With a cache: it forgets its lines; only while idle. */
  val invalidate = config.columnBvhMemory.cache.map(_ => Input(Bool()))

  /** With parity: a record in the cache is wrong. */
  val memoryError = Option.when(Lines.hasParity(config))(Output(Bool()))
  val tiles       = Flipped(new ColumnTiles(config))

  /** In any order. */
  val pixels   = Decoupled(new Pixel(config))
  val progress = Output(new ColumnProgress)

  /** If columns share the maps of the environment. */
  val environment = Option.when(config.columnsPerCopy > 1)(AttributePort.ofColumn(config))

  /** To the [[colonnade.environment.TextureMemory]]. */
  val texture = config.geometry.texture.map(_ => new TexturePort(PathConfig(config)))

  /** To the [[SharedLightCube]]. */
  val cube = CubePort(config)

  val events = Output(new EventSums(config, 1)) // delayed by one cycle
}

/** A column: a path tracer, its record memory, and the environment's marches and maps. A reset clears all but
  * the memories.
  *
  * @param pathTracer makes the path tracer; specs pass another one with the same ports
  */
@instantiable
final class Column(config: ColonnadeConfig, pathTracer: ColonnadeConfig => PathTracerModule = new PathTracer(_))
    extends Module {
  @public val io = IO(new ColumnIO(config))

  private val hasCache   = config.columnBvhMemory.cache.nonEmpty
  private val walker     = Module(new TileWalker(config))
  private val background = Module(new BackgroundWalker(config))
  private val tracer     = Module(pathTracer(config))
  private val units      = tracer.io
  private val controller = Module(new ColumnBvhController(config))
  private val collector  = Module(new PixelCollector(config, 3))

  // Walk tiles: pixel positions
  private val window = EnvironmentWindow(config, io.registers)
  walker.io.frame  := io.registers.frame
  walker.io.window := window
  walker.io.tiles :<>= io.tiles.ofObject
  units.positions :<>= walker.io.positions

  // Tiles of the environment
  walker.io.environmentLeaves := units.environmentLeaves
  private val environmentWalker = io.tiles.ofEnvironment.map { tiles =>
    val walker = Module(new EnvironmentWalker(config)).io
    walker.frame  := io.registers.frame
    walker.window := window
    walker.tiles :<>= tiles
    walker
  }
  for (from <- environmentWalker; to <- walker.io.environment) to :<>= from.positions

  // Tiles of the background, and pixels outside outline and window, become finished pixels at once
  background.io.frame  := io.registers.frame
  background.io.colour := io.registers.background
  background.io.tiles :<>= io.tiles.ofBackground
  for ((to, from) <- background.io.others.zip(walker.io.others +: environmentWalker.map(_.others).toSeq)) to :<>= from

  // Records: units send requests and receive all broadcasts
  controller.io.requests :<>= units.requests
  units.broadcasts := controller.io.broadcasts

  // The whole scene, or a cache of it
  private val memory = if (hasCache) None else Some(Module(new ColumnBvhMemory(config)))
  for (scratchpad <- memory) {
    scratchpad.io.banks <> controller.io.memory
    scratchpad.io.load := io.load
    scratchpad.io.holds.zip(io.holds).foreach { case (memoryHolds, holds) => memoryHolds := holds }
  }
  private val caches = controller.io.memory.filter(_ => hasCache).map { port =>
    val cache = Module(new ColumnCache(config))
    cache.io.port <> port
    cache.io
  }
  for ((cache, bank) <- caches.zipWithIndex) {
    io.lineRequests.get(bank) :<>= cache.request
    cache.lines      := io.lines.get(bank)
    cache.invalidate := io.invalidate.get
  }
  for (error <- io.memoryError) error := RegNext(caches.flatMap(_.error).reduce(_ || _), false.B)

  // Environment: marches read the column's own maps, or maps that columns share
  private val environment = config.physicalAttributeMemory.map(_ => Module(new ColumnEnvironment(config)).io)
  for (maps <- environment) {
    maps.load := io.load
    maps.shared.zip(io.environment).foreach { case (shared, port) => port <> shared }
  }
  private val marches = environment.map { maps =>
    val marches = Module(new EnvironmentMarches(PathConfig(config))).io
    marches.view  := io.registers.environment.get
    marches.start := io.start
    marches.paths :<>= units.marches.get
    maps.ports.zip(marches.maps).foreach { case (port, march) => port <> march }
    marches
  }

  for ((port, texture) <- io.texture.zip(units.texture)) port :<>= texture
  for ((port, cube) <- io.cube.zip(units.cube)) port :<>= cube

  // Collect finished pixels: a rejected one holds up the next position to render, and a finished one holds a context
  for ((source, pixels) <- collector.io.sources.zip(Seq(background.io.rejected, units.pixels, background.io.pixels)))
    source <> pixels
  io.pixels <> collector.io.pixels

  // Registers
  units.registers := io.registers
  units.start     := io.start

  // Progress: pixels that have started and not yet retired
  private val inFlight = RegInit(0.U((2 * config.numbers.coordinateBits).W))
  private val enters   = walker.io.positions.fire +& (background.io.rejected.fire || background.io.pixels.fire)
  private val retired  = io.pixels.fire
  inFlight := inFlight + enters - retired

  io.progress.isDrained := environmentWalker.fold(true.B)(_.isIdle) && walker.io.isIdle && background.io.isIdle &&
    inFlight === retired.asUInt
  io.progress.isIdle := RegNext(
    units.isIdle && controller.io.isIdle && caches.map(_.isIdle).fold(true.B)(_ && _),
    true.B
  )
  private val parts = units.events.parts ++ environment.map(_.events) ++ marches.map(_.events)
  io.events := RegNext(EventSums.ofColumn(config, enters, controller.io.events, parts))
}
