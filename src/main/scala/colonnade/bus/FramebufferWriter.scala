package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.axi.AxiWritePort
import colonnade.common.RoundRobin
import colonnade.config.{ColonnadeConfig, ShellConfig}
import colonnade.formats.Pixel

final class FramebufferWriterIO(config: ColonnadeConfig, shell: ShellConfig) extends Bundle {

  /** Constant from the start of a frame until idle. */
  val settings = Input(new FramebufferSettings)
  val pixels   = Vec(config.array.columns, Flipped(Decoupled(new Pixel(config))))
  val axi      = new AxiWritePort(BurstWriter.idBits, shell.busBytes)

  /** A pulse, while idle. */
  val clearErrors = Input(Bool())

  /** All pixels of the frame have come; until idle. */
  val flush  = Input(Bool())
  val isIdle = Output(Bool())

  /** Sticky until cleared. */
  val windowError   = Output(Bool())
  val responseError = Output(Bool())
}

/** Writes pixels to the framebuffer: encodes them, gathers them to rows of tiles, and writes each row as a burst.
  *
  * A row outside the window is dropped. After a write that fails, all rows are dropped until the errors are cleared.
  */
final class FramebufferWriter(config: ColonnadeConfig, shell: ShellConfig) extends Module {
  val io = IO(new FramebufferWriterIO(config, shell))

  private val encoders = Seq.fill(config.array.columns)(Module(new PixelEncoder(config)))
  private val buffers  = Seq.fill(config.array.columns)(Module(new RowBuffer(config, shell)))
  private val bursts   = Module(new BurstWriter(config, shell))

  for (((pixels, encoder), buffer) <- io.pixels.zip(encoders).zip(buffers)) {
    encoder.pixels :<>= pixels
    encoder.format := io.settings.format
    buffer.pixels :<>= encoder.out
    buffer.flush := io.flush && encoder.isIdle
  }

  private val arbiter = Module(new RoundRobin(config.array.columns))
  arbiter.io.requests  := VecInit(buffers.map(_.out.valid)).asUInt
  arbiter.io.isTaken   := bursts.io.rows.fire
  bursts.io.rows.valid := arbiter.io.requests.orR
  bursts.io.rows.bits  := Mux1H(arbiter.io.grant, buffers.map(_.out.bits))
  buffers.zip(arbiter.io.grant.asBools).foreach { case (buffer, isGranted) =>
    buffer.out.ready := isGranted && bursts.io.rows.ready
  }
  bursts.io.settings := io.settings
  bursts.io.drop     := io.responseError
  io.axi :<>= bursts.io.axi

  private def sticky(event: Bool): Bool = {
    val isSet = RegInit(false.B)
    isSet := event || (isSet && !io.clearErrors)
    isSet
  }
  io.windowError   := sticky(bursts.io.isOutside)
  io.responseError := sticky(io.axi.b.fire && io.axi.b.bits.resp =/= 0.U)
  io.isIdle        := encoders.map(_.isIdle).reduce(_ && _) && buffers.map(_.isIdle).reduce(_ && _) && bursts.io.isIdle
}
