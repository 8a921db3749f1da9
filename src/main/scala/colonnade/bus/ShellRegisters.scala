package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.axi.AxiLite
import colonnade.common.TimingSlice
import colonnade.config.{ColonnadeConfig, ShellConfig}
import colonnade.formats.{Access, RegisterFile, RegisterMap, RegisterPort}
import colonnade.refit.{RefitErrors, RefitResult, RefitSettings}

/** Pulses from the host. */
final class ShellCommands extends Bundle {
  val reset = Bool()
  val load  = Bool()
  val start = Bool()
}

/** The state of the shell, in the order of `status`, bit 0 last: it is in a soft reset, loads an image, has a frame
  * that waits for the end of the running one, runs a frame.
  */
final class ShellStatus extends Bundle {
  val isResetting = Bool()
  val isLoading   = Bool()
  val isQueued    = Bool()
  val isRunning   = Bool()
}

/** A write to a register of the device. */
final class PostedWrite(config: ColonnadeConfig) extends Bundle {
  val address = UInt(RegisterFile.addressBits(config).W)
  val data    = UInt(AxiLite.dataBits.W)
}

/** The refit unit, as the registers see it. */
final class RefitControl(config: ColonnadeConfig) extends Bundle {
  val start    = Output(Bool())
  val settings = Output(new RefitSettings(config))
  val result   = Input(new RefitResult(config))
  val errors   = Input(new RefitErrors)
  val isIdle   = Input(Bool())
}

final class ShellRegistersIO(config: ColonnadeConfig, shell: ShellConfig) extends Bundle {
  private val hasFrames = ShellMap.has("framebuffer", config, shell)

  val access = Flipped(new RegisterAccess(ShellMap.addressBits))

  /** To the device's registers. The port is lent to the shell's control in some cycles. */
  val device       = Flipped(new RegisterPort(RegisterFile.addressBits(config)))
  val deviceIsFree = Input(Bool())

  /** Of a device for frames. */
  val framebuffer = Option.when(hasFrames)(Output(new FramebufferSettings))
  val image       = Output(new ImageSettings)
  val refit       = Option.when(shell.refit)(new RefitControl(config))

  /** Of a device for rays: where its batches lie. */
  val window   = Option.when(ShellMap.has("rays", config, shell))(Output(new AddressWindow))
  val commands = Output(new ShellCommands)

  /** All writes to the device's registers have arrived there. */
  val writesAreDone = Output(Bool())

  val status            = Input(new ShellStatus)
  val framebufferErrors = Option.when(hasFrames)(Input(new FramebufferError))
  val imageErrors       = Input(new ImageError)

  /** Pulses, see [[Interrupts]]; of refits they are made here. */
  val events    = Input(UInt(Interrupts.ofFrames.size.W))
  val interrupt = Output(Bool())
}

/** The registers of [[ShellMap]], and the way to the device's. What is written there while a frame runs waits for
  * its end; all of the device's registers fit. A device for rays takes its tail while batches run, and its other
  * registers while none does.
  *
  * A request is answered two cycles later; the device's register port is registered. The answer is an error, and a
  * write has no effect, if the address has no register, the register cannot be written or not now, some bytes of the
  * word are not written, or the value does not fit.
  */
final class ShellRegisters(config: ColonnadeConfig, shell: ShellConfig) extends Module {
  val io = IO(new ShellRegistersIO(config, shell))

  private val request     = io.access.request.bits
  private val isDevice    = request.address >= (ShellMap.deviceBase / 4).U
  private val deviceWord  = request.address(RegisterFile.addressBits(config) - 1, 0)
  private val deviceWords = RegisterMap.size(RegisterMap(config))
  require(ShellMap.deviceBase + 4 * deviceWords <= (1 << ShellMap.addressBits), "the device's registers fit")

  // Writes to the device wait while a frame runs; of a device for rays, they arrive before the next request
  private val isForRays           = io.window.nonEmpty.B
  private val (posted, delivered) = withReset(reset.asBool || io.status.isResetting) {
    val queue = Module(new Queue(new PostedWrite(config), ShellMap.postedWrites(config), useSyncReadMem = true))
    (queue, TimingSlice.queue(queue.io.deq)) // of the memory's output
  }
  private val delivers = delivered.valid && (!io.status.isRunning || isForRays)
  delivered.ready  := !io.status.isRunning || isForRays
  io.writesAreDone := !posted.io.deq.valid && !delivered.valid

  io.access.request.ready := (!isDevice || request.isWrite || (io.deviceIsFree && !delivers)) &&
    ((io.writesAreDone && io.deviceIsFree) || !isForRays)
  private val accepts = io.access.request.fire
  private val writes  = accepts && request.isWrite && request.isWhole

  // Registers of the shell
  private val settings =
    ShellMap.of(config, shell).filter(_.access == Access.ReadWrite).filterNot(_.name == "interrupt.status")
  private val values = settings.map { register =>
    register.name -> Seq.tabulate(register.words) { word =>
      val bits = (register.width - word * AxiLite.dataBits).min(AxiLite.dataBits)
      RegInit(0.U(bits.W)).suggestName(s"${register.name.replace('.', '_')}_$word")
    }
  }.toMap
  private def value(name: String): UInt = Cat(values(name).reverse)

  private val isIdle    = !io.status.asUInt.orR
  private val canChange = !io.status.isQueued && !io.status.isResetting

  private val startsRefit = WireInit(false.B)

  /** Whether a register may be written now, by its name. */
  private def mayWrite(name: String): Bool = name match {
    case "control" =>
      val commands = request.data(2, 0)
      commands === 4.U || (commands === 2.U && isIdle) ||
      (commands === 1.U && canChange && !io.status.isLoading && !isForRays)
    case image if image.startsWith("image.")             => !io.status.isLoading
    case framebuffer if framebuffer.startsWith("frameb") => canChange
    case "photo.enabled"                                 => canChange && config.hasEnvironment.B
    case "stream.enabled"                                => canChange && shell.pixelStream.B
    case photo if photo.startsWith("photo.")             => canChange
    case window if window.startsWith("rays.")            => isIdle
    case refit if refit.startsWith("refit.") => io.refit.get.isIdle && !startsRefit && !io.status.isResetting
    case _                                   => true.B
  }

  private val writable = for {
    register <- ShellMap.of(config, shell)
    if register.access != Access.ReadOnly
    word <- 0 until register.words
    bits   = (register.width - word * AxiLite.dataBits).min(AxiLite.dataBits)
    isHere = !isDevice && request.address === ((register.address / 4) + word).U
    fits   = if (bits == AxiLite.dataBits) true.B else !(request.data >> bits).orR
  } yield (register.name, word) -> (isHere && fits && mayWrite(register.name))
  private val isWritable                               = writable.toMap
  private def written(name:     String, word: Int = 0) = writes && isWritable((name, word))
  private def writtenBits(name: String, bits: Int)     = Mux(written(name), request.data(bits - 1, 0), 0.U)
  for ((name, words) <- values; (word, index) <- words.zipWithIndex) when(written(name, index)) { word := request.data }

  // Refits: one that is refused ends in the cycle after its start
  private val refitDone = io.refit.map { refit =>
    startsRefit := RegNext(written("refit.control") && request.data(0), false.B)
    refit.start := startsRefit
    refit.settings.elements.foreach { case (name, setting) => setting := value(s"refit.$name") }
    val runs = RegInit(false.B)
    runs := (startsRefit || (runs && !refit.isIdle)) && !io.status.isResetting
    runs && refit.isIdle
  }

  // Before the answer
  io.commands := RegNext(writtenBits("control", 3), 0.U).asTypeOf(io.commands)

  private val sources    = Interrupts.of(shell).size
  private val interrupts = Module(new InterruptController(sources))
  interrupts.io.events := refitDone.fold(io.events)(_ ## io.events)
  interrupts.io.clear  := writtenBits("interrupt.status", sources)
  interrupts.io.test   := writtenBits("interrupt.test", sources)
  interrupts.io.enable := value("interrupt.enable")
  io.interrupt         := interrupts.io.interrupt

  for (framebuffer <- io.framebuffer) {
    framebuffer.base               := value("framebuffer.base")
    framebuffer.stride             := value("framebuffer.stride")
    framebuffer.format             := value("framebuffer.format")
    framebuffer.toStream           := value("stream.enabled")
    framebuffer.window             := window("framebuffer")
    framebuffer.photo.base         := value("photo.base")
    framebuffer.photo.stride       := value("photo.stride")
    framebuffer.photo.isEnabled    := value("photo.enabled")
    framebuffer.photo.hasStrengths := value("photo.hasStrengths")
    framebuffer.photo.window       := window("photo")
  }
  io.image.base   := value("image.base")
  io.image.bytes  := value("image.bytes")
  io.image.window := window("image")
  io.window.foreach(_ := window("rays"))

  private def window(of: String): AddressWindow = {
    val window = Wire(new AddressWindow)
    window.base := value(s"$of.windowBase")
    window.end  := value(s"$of.windowEnd")
    window
  }

  // Registers of the device
  private val tail      = RegisterMap(config).find(_.name == "rays.tail").fold(false.B)(deviceWord === _.address.U)
  private val mayChange = if (io.window.nonEmpty) isIdle || (tail && io.status.isRunning && canChange) else canChange
  private val deviceWritable =
    VecInit(ShellMap.writableWords(config).map(_.U === deviceWord)).asUInt.orR && mayChange && posted.io.enq.ready
  private val inDevice = isDevice && request.address < (ShellMap.deviceBase / 4 + deviceWords).U
  posted.io.enq.valid        := writes && inDevice && deviceWritable
  posted.io.enq.bits.address := deviceWord
  posted.io.enq.bits.data    := request.data
  io.device.address          := Mux(delivers, delivered.bits.address, deviceWord)
  io.device.read             := accepts && !request.isWrite && inDevice
  io.device.write            := delivers
  io.device.writeData        := delivered.bits.data

  // Answers
  private val constants = Map(
    "identity"     -> ShellMap.identity,
    "version"      -> ShellMap.version,
    "capabilities" -> ShellMap.capabilities(config, shell),
    "frameSize"    -> ShellMap.frameSize(config)
  ) ++ ShellMap.formatHash(config).zipWithIndex.map { case (word, index) => s"formatHash[$index]" -> word }
  private val observed = Map(
    "status"           -> io.status.asUInt,
    "interrupt.status" -> interrupts.io.status,
    "image.errors"     -> io.imageErrors.asUInt
  ) ++ io.framebufferErrors.map("framebuffer.errors" -> _.asUInt) ++ io.refit.toSeq.flatMap { refit =>
    val bounds = refit.result.low.axes ++ refit.result.high.axes
    Map(
      "refit.status"    -> Mux(refit.isIdle, 0.U, 1.U),
      "refit.errors"    -> refit.errors.asUInt,
      "refit.flatPairs" -> refit.result.flatPairs
    ) ++
      bounds.zipWithIndex.map { case (bound, i) => s"refit.bounds[$i]" -> bound }
  }
  private val readable = for {
    register <- ShellMap.of(config, shell)
    if register.access != Access.WriteOnly
    word <- 0 until register.words
    data = values.get(register.name).map(_(word)).orElse(observed.get(register.name))
      .getOrElse(constants(register.name).U(AxiLite.dataBits.W))
  } yield (!isDevice && request.address === (register.address / 4 + word).U) -> data.pad(AxiLite.dataBits)

  private val wasDevice = answered(inDevice)
  private val data      = answered(Mux1H(readable))
  private val mayRead   = inDevice || VecInit(readable.map(_._1)).asUInt.orR
  private val isWrite   = VecInit(writable.map(_._2)).asUInt.orR || (inDevice && deviceWritable)
  io.access.response.valid        := ShiftRegister(accepts, ShellRegisters.answerCycles, false.B, true.B)
  io.access.response.bits.data    := Mux(wasDevice, io.device.readData, data)
  io.access.response.bits.isError := answered(Mux(request.isWrite, !(isWrite && request.isWhole), !mayRead))

  private def answered[T <: Data](value: T): T = ShiftRegister(value, ShellRegisters.answerCycles)
}

private object ShellRegisters {
  val answerCycles: Int = 2 // from a request to its answer, which may come from the device
}
