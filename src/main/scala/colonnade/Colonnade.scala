package colonnade

import chisel3._
import chisel3.experimental.hierarchy.{Definition, Instance}
import chisel3.util.{Decoupled, Pipe}
import colonnade.common.TimingSlice
import colonnade.column.{Column, PathTracer, PathTracerModule, SharedLightCube}
import colonnade.config.ColonnadeConfig
import colonnade.environment.{AttributeArbiter, PhysicalAttributeMemory, TextureMemory}
import colonnade.formats.{Load, Pixel, RegisterFile, RegisterPort}
import colonnade.frame.{CounterFile, EnvironmentWindow, FrameController}
import colonnade.memory.{DramPort, SceneMemory, SharedCache}

final class ColonnadeIO(config: ColonnadeConfig) extends Bundle {
  val register = new RegisterPort(RegisterFile.addressBits(config))
  val load     = Flipped(Decoupled(new Load(config))) // ready while no frame runs

  /** One stream per column, in any order; each pixel of a frame comes once. */
  val pixels = Vec(config.array.columns, Decoupled(new Pixel(config)))

  /** For verification, if the memory is holdable: stalls banks, one bit per bank, column by column. */
  val memoryHolds =
    if (config.columnBvhMemory.holdable) Some(Input(UInt((config.array.columns * config.columnBvhMemory.banks).W)))
    else None

  /** With a cache: reads of the scene in DRAM. */
  val memory = config.columnBvhMemory.cache.map(_ => DramPort(config))

  val done = Output(Bool()) // the frame is complete; cleared by the next start
}

/** The device: columns of path tracers, run frame by frame.
  *
  * The host loads the records, writes the frame registers and starts the frame. It accepts pixels until `done`, then
  * reads errors and counters. A frame with an error bit is invalid. An aborted frame withdraws pixels that the sink has
  * not accepted.
  *
  * @param pathTracer makes the path tracer of a column; specs pass another one with the same ports
  */
final class Colonnade(config: ColonnadeConfig, pathTracer: ColonnadeConfig => PathTracerModule = new PathTracer(_))
    extends Module {
  val io = IO(new ColonnadeIO(config))

  private val registers  = Module(RegisterFile.ofFrames(config))
  private val controller = Module(new FrameController(config))
  private val counters   = Module(new CounterFile(config))
  private val clears     = reset.asBool || controller.io.aborts
  private val definition = Definition(new Column(config, pathTracer)) // elaborated once, not once per column
  private val columns    = Seq.fill(config.array.columns)(withReset(clears)(Instance(definition)))

  // Loads go to all columns
  private val load = Pipe(io.load.fire, io.load.bits)
  io.load.ready := !controller.io.status.busy
  columns.foreach(_.io.load := load)

  // The environment's maps, if columns share them
  for (ports <- columns.flatMap(_.io.environment).grouped(config.columnsPerCopy)) {
    val tagBits = AttributeArbiter.tagBits(config.mapRequesters)
    val maps    = withReset(clears)(Module(new PhysicalAttributeMemory(config, ports.size, tagBits)))
    maps.io.load := load
    maps.io.ports.zip(ports).foreach { case (port, column) => port <> column }
  }

  // The textures
  for (ports <- columns.flatMap(_.io.texture).grouped(TextureMemory.columns)) {
    val textures = withReset(clears)(Module(new TextureMemory(config, ports.size))).io
    textures.load := load
    textures.ports.zip(ports).foreach { case (port, column) => port :<>= column }
  }

  // The light cube
  for (ports <- columns.flatMap(_.io.cube).grouped(SharedLightCube.columns)) {
    val cube = Module(new SharedLightCube(config, ports.size)).io
    cube.load := load
    cube.ports.zip(ports).foreach { case (port, column) => port :<>= column }
  }

  // The scene in DRAM. After a request or a failed read, the caches forget it at the next start
  private val sceneMemory = config.columnBvhMemory.cache.map(_ => Module(new SceneMemory(config)).io)
  for (memory <- sceneMemory) {
    val isWrong    = columns.flatMap(_.io.memoryError).fold(false.B)(_ || _) // by parity
    val hasFailed  = memory.events.error || controller.io.memoryTimeout || isWrong
    val isStale    = RegInit(false.B)
    val invalidate = isStale && controller.io.frameStart
    isStale     := (isStale && !invalidate) || registers.io.invalidate.get || hasFailed
    memory.page := registers.io.frame.dram.get.page
    io.memory.get :<>= memory.axi
    // The caches forget a cycle later, still before the frame's first request
    val forgets = TimingSlice.flag(invalidate)
    memory.invalidate := forgets
    for (((column, requests), index) <- columns.zip(memory.requests).zipWithIndex) {
      requests :<>= column.io.lineRequests.get
      column.io.lines.get      := memory.lines(SharedCache.busOf(config, index))
      column.io.invalidate.get := forgets
    }
    counters.io.dramReads.get   := memory.events.dramReads
    counters.io.memoryError.get := hasFailed
  }
  controller.io.memoryIsIdle := sceneMemory.fold(true.B)(_.isIdle)

  // Frame: tiles to the columns, pixels from them
  registers.io.register <> io.register
  controller.io.start  := registers.io.start
  controller.io.frame  := registers.io.frame.frame
  controller.io.window := EnvironmentWindow(config, registers.io.frame)
  for ((column, index) <- columns.zipWithIndex) {
    column.io.registers := registers.io.frame
    column.io.start     := controller.io.frameStart
    column.io.tiles :<>= controller.io.tiles(index)
    io.pixels(index) <> column.io.pixels
    for (columnHolds <- column.io.holds; holds <- io.memoryHolds) {
      columnHolds := holds >> (index * config.columnBvhMemory.banks)
    }
    controller.io.progress(index) := column.io.progress
    counters.io.events(index)     := column.io.events
  }
  controller.io.traffic.retires := io.pixels.map(_.fire).reduce(_ || _)
  controller.io.traffic.stalls  := io.pixels.map(pixels => pixels.valid && !pixels.ready).reduce(_ || _)

  // Status for the host
  counters.io.clear      := controller.io.frameStart
  counters.io.isCounting := controller.io.isRunning

  private val device = registers.io.device
  device.status                                                                   := controller.io.status
  device.counters                                                                 := counters.io.counters
  device.errors.stackOverflow                                                     := counters.io.stackOverflow
  device.errors.illegalRecord                                                     := counters.io.illegalRecord
  device.errors.watchdog                                                          := controller.io.watchdogError
  for (error <- device.errors.memory; isError <- counters.io.isMemoryError) error := isError
  io.done                                                                         := device.status.done
}
