package colonnade

import chisel3._
import colonnade.axi.AxiPins
import colonnade.bus._
import colonnade.common.TimingSlice
import colonnade.config.{ColonnadeConfig, ShellConfig}
import colonnade.formats.RayBatch
import colonnade.memory.DramPort
import colonnade.query.RayPort

/** The device for rays in its AXI4 shell: registers by AXI4-Lite, images, batches, rays and hits by an AXI4 master, an
  * interrupt; docs/bus-shell.md. Its module and pins have the names of [[ColonnadeAxi]].
  */
final class ColonnadeRaysAxi(config: ColonnadeConfig, shell: ShellConfig) extends Module with ShellPins {
  require(shell == ShellConfig(RayBatch.bytes), "the shell has the bus of the device")
  override val desiredName: String = "ColonnadeAxi"

  private val idBits    = RayPort.idBits(config.array.columns + 1)
  private val maxBursts = 8 * (config.array.columns + 1) // more wait

  val registerPins = IO(AxiPins.lite(ShellMap.addressBits)).suggestName("s_axil")
  val masterPins   = IO(AxiPins.readsAndWrites(idBits, shell.busBytes)).suggestName("m_axi")

  /** With a cache: reads of the scene in DRAM. */
  val scenePins = config.columnBvhMemory.cache.map { cache =>
    IO(AxiPins.reads(DramPort.idBits(config), cache.busBytes)).suggestName("m_axi_scene")
  }
  val interrupt = IO(Output(Bool())).suggestName("irq")

  private val slave      = Module(new AxiLiteSlave(ShellMap.addressBits))
  private val registers  = Module(new ShellRegisters(config, shell))
  private val control    = Module(new ShellControl(config, shell))
  private val writeGuard = Module(new AxiWriteGuard(idBits, shell.busBytes))
  private val readGuard  = Module(new AxiReadGuard(idBits, shell.busBytes, maxBursts))
  private val clears     = ShellControl.clears(config, reset.asBool, control.io)
  private val device     = withReset(clears)(Module(new ColonnadeRays(config)))
  private val window     = withReset(clears)(Module(new AxiWindow(idBits, shell.busBytes)))
  private val loader     = withReset(clears)(Module(new ImageLoader(config, shell)))

  // Registers; the device's port is a cycle later
  registerPins.attach(slave.axi)
  registers.io.access :<>= slave.access
  registers.io.imageErrors      := loader.io.errors
  registers.io.status           := control.io.status
  registers.io.status.isRunning := !device.io.done
  registers.io.events           := control.io.events | (device.io.batchError ## false.B ## device.io.batchDone)
  interrupt                     := registers.io.interrupt
  private val port = registers.io.device
  port.readData                := device.io.register.readData
  device.io.register.write     := TimingSlice.flag(port.write)
  device.io.register.read      := TimingSlice.flag(port.read)
  device.io.register.address   := TimingSlice(port.address)
  device.io.register.writeData := TimingSlice(port.writeData)
  registers.io.deviceIsFree    := !device.io.register.write
  device.io.memoryHolds.foreach(_ := 0.U)

  // Loads and resets; no frame is started
  control.io.commands      := registers.io.commands
  control.io.settings      := 0.U.asTypeOf(control.io.settings)
  control.io.writesAreDone := true.B
  control.io.deviceDone    := true.B
  control.io.writerIsIdle  := true.B
  control.io.writerErrors  := 0.U.asTypeOf(control.io.writerErrors)
  control.io.loaderIsIdle  := loader.io.isIdle
  control.io.loadError     := loader.io.errors.asUInt.orR
  loader.io.start          := control.io.load
  loader.io.settings       := registers.io.image
  device.io.load :<>= loader.io.load

  // Batches, in their window; or an image
  private val isLoading = control.io.status.isLoading
  window.io.window := registers.io.window.get
  window.io.innerRead :<>= device.io.read
  window.io.innerWrite :<>= device.io.write
  window.io.readIsIdle  := readGuard.io.isIdle
  window.io.writeIsIdle := writeGuard.io.isIdle
  writeGuard.io.inner :<>= window.io.write
  ColonnadeAxi.shareReads(readGuard, Seq(isLoading -> loader.io.axi, !isLoading -> window.io.read))

  // The bus
  Seq("aw" -> writeGuard.io.axi.aw, "w" -> writeGuard.io.axi.w, "ar" -> readGuard.io.axi.ar).foreach {
    case (channel, stream) => masterPins.drive(channel, stream)
  }
  masterPins.receive("b", writeGuard.io.axi.b)
  masterPins.receive("r", readGuard.io.axi.r)
  private val sceneGuard = scenePins.map(ColonnadeAxi.guardScene(config, _, device.io.memory.get))
  private val guards     = readGuard +: sceneGuard.toSeq
  guards.foreach(_.io.abandon := control.io.reset)
  writeGuard.io.abandon := control.io.reset
  control.io.busIsIdle  := writeGuard.io.isIdle && guards.map(_.io.isIdle).reduce(_ && _)
}
