package colonnade

import chisel3._
import chisel3.util.Mux1H
import colonnade.axi.{AxiPins, AxiReadPort}
import colonnade.bus._
import colonnade.common.TimingSlice
import colonnade.column.{PathTracer, PathTracerModule}
import colonnade.config.{ColonnadeConfig, ShellConfig}
import colonnade.formats.RegisterMap
import colonnade.memory.DramPort
import colonnade.refit.{RefitReader, RefitUnit}

/** Pins of a shell. */
trait ShellPins {
  def registerPins: AxiPins
  def masterPins: AxiPins
  def interrupt: Bool

  /** Of a refit unit. */
  def refitPins: Option[AxiPins] = None
}

/** The device in its AXI4 shell: registers by AXI4-Lite, images read and frames written by an AXI4 master, an
  * interrupt; docs/bus-shell.md.
  *
  * @param pathTracer makes the path tracer of a column; specs pass another one with the same ports
  */
final class ColonnadeAxi(
    config:     ColonnadeConfig,
    shell:      ShellConfig,
    pathTracer: ColonnadeConfig => PathTracerModule = new PathTracer(_)
) extends Module
    with ShellPins {
  val registerPins = IO(AxiPins.lite(ShellMap.addressBits)).suggestName("s_axil")
  val masterPins   = IO(AxiPins.readsAndWrites(BurstWriter.idBits, shell.busBytes)).suggestName("m_axi")

  /** With a cache: reads of the scene in DRAM. */
  val scenePins = config.columnBvhMemory.cache.map { cache =>
    IO(AxiPins.reads(DramPort.idBits(config), cache.busBytes)).suggestName("m_axi_scene")
  }

  /** With a pixel stream: rows of tiles. */
  val streamPins =
    Option.when(shell.pixelStream)(IO(AxiPins.stream(new PixelBeat(shell.busBytes))).suggestName("m_axis"))

  /** With a refit unit: what it reads and writes. */
  override val refitPins = Option.when(shell.refit)(
    IO(AxiPins.readsAndWrites(RefitReader.idBits, shell.busBytes)).suggestName("m_axi_refit")
  )
  val interrupt = IO(Output(Bool())).suggestName("irq")

  private val slave      = Module(new AxiLiteSlave(ShellMap.addressBits))
  private val registers  = Module(new ShellRegisters(config, shell))
  private val control    = Module(new ShellControl(config, shell))
  private val writeGuard = Module(new AxiWriteGuard(BurstWriter.idBits, shell.busBytes))
  private val readGuard  = Module(new AxiReadGuard(BurstWriter.idBits, shell.busBytes, PhotoCompositor.maxRows))

  private val streamGuard = streamPins.map(_ => Module(new StreamGuard(shell.busBytes)))

  private val clears = ShellControl.clears(config, reset.asBool, control.io)
  private val device = withReset(clears)(Module(new Colonnade(config, pathTracer)))
  private val writer = withReset(clears)(Module(new FramebufferWriter(config, shell)))
  private val loader = withReset(clears)(Module(new ImageLoader(config, shell)))

  // Registers
  registerPins.attach(slave.axi)
  registers.io.access :<>= slave.access
  registers.io.framebufferErrors.get := control.io.errors
  registers.io.imageErrors           := loader.io.errors
  registers.io.status                := control.io.status
  registers.io.events                := control.io.events
  registers.io.deviceIsFree          := !control.io.start
  interrupt                          := registers.io.interrupt
  control.io.commands                := registers.io.commands
  control.io.settings                := registers.io.framebuffer.get
  control.io.writesAreDone           := registers.io.writesAreDone

  // The device's register port, a cycle later: the host's, or the start of a frame
  private val start = RegisterMap(config).find(_.name == "control.start").get
  private val port  = Wire(chiselTypeOf(registers.io.device))
  port <> registers.io.device
  when(control.io.start) {
    port.write     := true.B
    port.address   := start.address.U
    port.writeData := 1.U
  }
  port.readData                := device.io.register.readData
  device.io.register.write     := TimingSlice.flag(port.write)
  device.io.register.read      := TimingSlice.flag(port.read)
  device.io.register.address   := TimingSlice(port.address)
  device.io.register.writeData := TimingSlice(port.writeData)
  private val isStarting = TimingSlice.flag(control.io.start)
  device.io.memoryHolds.foreach(_ := 0.U)

  // Frames
  private val isWriting = writeGuard.io.inner.aw.valid || writeGuard.io.inner.w.valid
  control.io.deviceDone   := device.io.done && !isStarting
  control.io.writerIsIdle := writer.io.isIdle && !isWriting && writeGuard.io.isIdle && streamGuard.fold(true.B)(
    _.isIdle
  )
  control.io.writerErrors := writer.io.errors
  writer.io.clearErrors   := control.io.clearErrors
  writer.io.flush         := control.io.flush
  writer.io.settings      := control.io.framebuffer
  writer.io.pixels.zip(device.io.pixels).foreach { case (sink, pixels) => sink :<>= pixels }
  writeGuard.io.inner.aw :<>= withReset(clears)(TimingSlice.queue(writer.io.axi.aw))
  writeGuard.io.inner.w :<>= withReset(clears)(TimingSlice.queue(writer.io.axi.w))
  writer.io.axi.b :<>= writeGuard.io.inner.b
  for (pins <- streamPins; guard <- streamGuard) {
    guard.inner :<>= writer.io.stream.get
    guard.abandon := control.io.reset
    pins.stream(guard.out)
  }

  // Images
  control.io.loaderIsIdle := loader.io.isIdle
  control.io.loadError    := loader.io.errors.asUInt.orR
  loader.io.start         := control.io.load
  loader.io.settings      := registers.io.image
  device.io.load :<>= loader.io.load

  // Reads: of an image, or of the photo while a frame runs
  private val isLoading = control.io.status.isLoading
  ColonnadeAxi.shareReads(readGuard, Seq(isLoading -> loader.io.axi) ++ writer.io.photo.map(!isLoading -> _))

  // The bus
  private val master = Seq("aw" -> writeGuard.io.axi.aw, "w" -> writeGuard.io.axi.w, "ar" -> readGuard.io.axi.ar)
  master.foreach { case (channel, stream) => masterPins.drive(channel, stream) }
  masterPins.receive("b", writeGuard.io.axi.b)
  masterPins.receive("r", readGuard.io.axi.r)
  private val sceneGuard  = scenePins.map(ColonnadeAxi.guardScene(config, _, device.io.memory.get))
  private val refitGuards = refitPins.map { pins =>
    val unit   = withReset(clears)(Module(new RefitUnit(config, shell.busBytes)))
    val reads  = Module(new AxiReadGuard(RefitReader.idBits, shell.busBytes, ColonnadeAxi.refitBursts))
    val writes = Module(new AxiWriteGuard(RefitReader.idBits, shell.busBytes, ColonnadeAxi.refitBursts))
    registers.io.refit.foreach { control =>
      unit.io.start    := control.start
      unit.io.settings := control.settings
      control.result   := unit.io.result
      control.errors   := unit.io.errors
      control.isIdle   := unit.io.isIdle
    }
    reads.io.inner :<>= unit.io.reads
    writes.io.inner :<>= unit.io.writes
    Seq("aw" -> writes.io.axi.aw, "w" -> writes.io.axi.w, "ar" -> reads.io.axi.ar).foreach { case (channel, stream) =>
      pins.drive(channel, stream)
    }
    pins.receive("b", writes.io.axi.b)
    pins.receive("r", reads.io.axi.r)
    writes.io.abandon := control.io.reset
    (reads, writes)
  }
  private val guards = (readGuard +: sceneGuard.toSeq) ++ refitGuards.map(_._1)
  guards.foreach(_.io.abandon := control.io.reset)
  writeGuard.io.abandon := control.io.reset
  control.io.busIsIdle  := writeGuard.io.isIdle && refitGuards.fold(true.B)(_._2.io.isIdle) && streamGuard.fold(true.B)(
    _.isIdle
  ) && guards.map(
    _.io.isIdle
  ).reduce(_ && _)
}

private object ColonnadeAxi {
  val refitBursts: Int = 64 // of the refit unit that are under way, reads and writes each

  /** Connects a guard to the one of its readers whose condition holds; the others see neither its addresses nor data. A
    * reader may have fewer ids.
    */
  def shareReads(guard: AxiReadGuard, readers: Seq[(Bool, AxiReadPort)]): Unit = {
    val port = guard.io.inner
    port.ar.valid := VecInit(readers.map { case (isOn, reader) => isOn && reader.ar.valid }).asUInt.orR
    port.ar.bits  := Mux1H(readers.map { case (isOn, reader) =>
      val address = Wire(chiselTypeOf(port.ar.bits))
      address := reader.ar.bits
      isOn    -> address
    })
    port.r.ready := VecInit(readers.map { case (isOn, reader) => isOn && reader.r.ready }).asUInt.orR
    for ((isOn, reader) <- readers) {
      reader.ar.ready := isOn && port.ar.ready
      reader.r.valid  := isOn && port.r.valid
      reader.r.bits   := port.r.bits
    }
  }

  /** The guard between a device's reads of the scene and their pins. */
  def guardScene(config: ColonnadeConfig, pins: AxiPins, memory: AxiReadPort): AxiReadGuard = {
    val cache = config.columnBvhMemory.cache.get
    val guard = Module(new AxiReadGuard(DramPort.idBits(config), cache.busBytes, cache.sharedMisses + 2))
    guard.io.inner :<>= memory
    pins.drive("ar", guard.io.axi.ar)
    pins.receive("r", guard.io.axi.r)
    guard
  }
}
