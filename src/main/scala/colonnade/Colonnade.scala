package colonnade

import chisel3._
import chisel3.util.{Decoupled, Pipe}
import colonnade.column.Column
import colonnade.config.ColonnadeConfig
import colonnade.environment.{AttributeArbiter, AttributePort, PhysicalAttributeMemory}
import colonnade.formats.{Load, Pixel, RegisterFile, RegisterPort}
import colonnade.frame.{CounterFile, FrameController, RoomWindow}
import colonnade.unit.{RenderUnit, RenderUnitIO}

/** Ports of [[Colonnade]]. */
final class ColonnadeIO(config: ColonnadeConfig) extends Bundle {
  val register = new RegisterPort(RegisterFile.addressBits(config))

  /** Ready while no frame runs. */
  val load = Flipped(Decoupled(new Load(config)))

  /** One stream for each column, in no particular order; all pixels of a frame come once. */
  val pixels = Vec(config.array.columns, Decoupled(new Pixel(config)))

  /** Only of a holdable memory: which banks wait, one bit for each, column by column. For verification. */
  val memoryHolds =
    if (config.columnBvhMemory.holdable) Some(Input(UInt((config.array.columns * config.columnBvhMemory.banks).W)))
    else None

  /** The frame is complete; falls with the next start. */
  val done = Output(Bool())
}

/** The device: columns of render units, run frame by frame.
  *
  * Load the records, write the frame registers, start; take the pixels until `done`, then read errors and counters. A
  * frame with an error bit is not to be shown. An aborted frame withdraws pixels that the sink has not taken.
  *
  * @param renderUnit makes a render unit; another one with the same ports for specs
  */
final class Colonnade(
    config:     ColonnadeConfig,
    renderUnit: ColonnadeConfig => Module { val io: RenderUnitIO } = new RenderUnit(_)
) extends Module {
  val io = IO(new ColonnadeIO(config))

  private val registers  = Module(new RegisterFile(config))
  private val controller = Module(new FrameController(config))
  private val counters   = Module(new CounterFile(config))
  private val clears     = reset.asBool || controller.io.aborts
  private val columns    = Seq.fill(config.array.columns)(withReset(clears)(Module(new Column(config, renderUnit))))

  // Records go to all columns
  private val load = Pipe(io.load.fire, io.load.bits)
  io.load.ready := !controller.io.status.busy
  columns.foreach(_.io.load := load)

  // Maps of a room that all columns share
  for (ports <- Some(columns.flatMap(_.io.room)) if ports.nonEmpty) {
    val tagBits = AttributeArbiter.tagBits(config.array.rows, AttributePort.tagBits(config))
    val maps    = withReset(clears)(Module(new PhysicalAttributeMemory(config, config.array.columns, tagBits)))
    maps.io.load := load
    maps.io.ports.zip(ports).foreach { case (port, column) => port <> column }
  }

  // A frame: tiles out, pixels back
  registers.io.register <> io.register
  controller.io.start  := registers.io.start
  controller.io.frame  := registers.io.frame.frame
  controller.io.window := RoomWindow(config, registers.io.frame)
  for ((column, index) <- columns.zipWithIndex) {
    column.io.registers := registers.io.frame
    column.io.start     := controller.io.begins
    column.io.tiles <> controller.io.tiles(index)
    column.io.backgroundTiles <> controller.io.backgroundTiles(index)
    io.pixels(index) <> column.io.pixels
    for (columnHolds <- column.io.holds; holds <- io.memoryHolds) {
      columnHolds := holds >> (index * config.columnBvhMemory.banks)
    }
    controller.io.progress(index) := column.io.progress
    counters.io.events(index)     := column.io.events
  }
  controller.io.traffic.leaves := io.pixels.map(_.fire).reduce(_ || _)
  controller.io.traffic.stalls := io.pixels.map(pixels => pixels.valid && !pixels.ready).reduce(_ || _)

  // What the host reads
  counters.io.clear      := controller.io.begins
  counters.io.isCounting := controller.io.isRunning

  private val device = registers.io.device
  device.status               := controller.io.status
  device.counters             := counters.io.counters
  device.errors.stackOverflow := counters.io.stackOverflow
  device.errors.illegalRecord := counters.io.illegalRecord
  device.errors.watchdog      := controller.io.watchdogError
  io.done                     := device.status.done
}
