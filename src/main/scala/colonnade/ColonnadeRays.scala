package colonnade

import chisel3._
import chisel3.util.Decoupled
import colonnade.axi.{AxiPins, AxiReadPort, AxiWritePort}
import colonnade.bus._
import colonnade.common.TimingSlice
import colonnade.config.{ColonnadeConfig, ShellConfig}
import colonnade.formats.{Load, RayBatch, RegisterFile, RegisterPort}
import colonnade.memory.DramPort
import colonnade.query.{RayArray, RayPort}

final class ColonnadeRaysIO(config: ColonnadeConfig) extends Bundle {
  private val ids = RayPort.idBits(config.array.columns + 1)

  val register = new RegisterPort(RegisterFile.addressBits(config))
  val load     = Flipped(Decoupled(new Load(config))) // ready while no batch runs

  /** Batches, rays and hits in memory. */
  val read  = new AxiReadPort(ids, RayBatch.bytes)
  val write = new AxiWritePort(ids, RayBatch.bytes)

  /** As of [[ColonnadeIO]]. */
  val memoryHolds = Option.when(config.columnBvhMemory.holdable)(
    Input(UInt((config.array.columns * config.columnBvhMemory.banks).W))
  )
  val memory = config.columnBvhMemory.cache.map(_ => DramPort(config))
  val done   = Output(Bool()) // no batch runs

  /** Pulses: a batch has ended; one was refused, or has failed. */
  val batchDone  = Output(Bool())
  val batchError = Output(Bool())
}

/** A device that answers rays of applications: docs/rays.md. The host loads the records, writes the registers, puts
  * batches into the ring, and moves `rays.tail`.
  */
final class ColonnadeRays(config: ColonnadeConfig) extends Module {
  require(config.queries.nonEmpty, "a device for rays needs queries")
  val io = IO(new ColonnadeRaysIO(config))

  private val registers = Module(RegisterFile.ofRays(config)).io
  private val array     = Module(new RayArray(config)).io
  registers.register <> io.register
  array.registers  := registers.frame
  array.tail       := registers.commands.get.tail
  array.invalidate := registers.invalidate.getOrElse(false.B)
  array.load :<>= io.load
  io.read :<>= array.read
  io.write :<>= array.write
  array.memoryHolds.zip(io.memoryHolds).foreach { case (to, from) => to := from }
  io.memory.zip(array.memory).foreach { case (to, from) => to :<>= from }
  io.done       := !array.isBusy
  io.batchDone  := array.head =/= RegNext(array.head, 0.U)
  io.batchError := RegNext(array.batchError, false.B)

  // Counters and errors, since the last start
  private val status = registers.device
  private val events = array.events
  status.status.busy := array.isBusy
  status.status.done := io.done
  status.rays.head   := array.head

  private def sum(event: UInt): UInt = {
    val counter = RegInit(0.U(status.counters.cycles.getWidth.W))
    counter := Mux(registers.start, 0.U, counter + RegNext(event, 0.U))
    counter
  }
  private def sticky(event: Bool): Bool = {
    val flag = RegInit(false.B)
    flag := event || (flag && !registers.start)
    flag
  }
  status.counters.cycles        := sum(array.isBusy.asUInt)
  status.counters.rays          := sum(array.raysDone)
  status.counters.raysRefused   := sum(events.map(_.raysRefused.asUInt).reduce(_ +& _))
  status.counters.raysInBox     := sum(events.map(_.raysInBox).reduce(_ +& _))
  status.counters.nodeReads     := sum(events.map(_.nodeReads).reduce(_ +& _))
  status.counters.boxTests      := sum(events.map(_.boxTests).reduce(_ +& _))
  status.counters.triangleTests := sum(events.map(_.triangleTests).reduce(_ +& _))
  status.counters.deepestStack  := RegNext(events.map(_.deepestStack).reduce((a, b) => Mux(a > b, a, b)))
  status.errors.stackOverflow   := sticky(events.map(_.stackOverflow).reduce(_ || _))
  status.errors.illegalRecord   := sticky(events.map(_.illegalRecord).reduce(_ || _))
  status.errors.batch           := sticky(array.batchError)
  status.errors.memory.foreach(_ := sticky(array.memoryError))
}

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
