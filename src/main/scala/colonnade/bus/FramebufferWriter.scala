package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.axi.{AxiReadPort, AxiWritePort}
import colonnade.common.RoundRobin
import colonnade.config.{ColonnadeConfig, ShellConfig}
import colonnade.formats.Pixel

/** Errors of a frame that is being written; sticky. */
final class WriterErrors extends Bundle {
  val photoResponse = Bool()
  val photoWindow   = Bool()
  val response      = Bool()
  val window        = Bool()
}

final class FramebufferWriterIO(config: ColonnadeConfig, shell: ShellConfig) extends Bundle {

  /** Constant from the start of a frame until idle. */
  val settings = Input(new FramebufferSettings)
  val pixels   = Vec(config.array.columns, Flipped(Decoupled(new Pixel(config))))
  val axi      = new AxiWritePort(BurstWriter.idBits, shell.busBytes)

  /** With an environment, reads of the photo; with a pixel stream, rows of frames that go there. */
  val photo  = Option.when(config.hasEnvironment)(new AxiReadPort(BurstWriter.idBits, shell.busBytes))
  val stream = Option.when(shell.pixelStream)(Decoupled(new PixelBeat(shell.busBytes)))

  val clearErrors = Input(Bool()) // a pulse, while idle

  /** All pixels of the frame have come; until idle. */
  val flush  = Input(Bool())
  val isIdle = Output(Bool())

  val errors = Output(new WriterErrors) // until cleared
}

/** Writes pixels to the framebuffer: encodes them, gathers them to rows of tiles, puts the photo into the pixels that
  * do not show the object, and writes each row as a burst.
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

  for (encoder <- encoders; composites <- encoder.composites) composites := io.settings.photo.isEnabled

  private val arbiter = Module(new RoundRobin(config.array.columns))
  private val rows    = Wire(Decoupled(new TileRow(config, PixelWord.bits(config))))
  arbiter.io.requests := VecInit(buffers.map(_.out.valid)).asUInt
  arbiter.io.isTaken  := rows.fire
  rows.valid          := arbiter.io.requests.orR
  rows.bits           := Mux1H(arbiter.io.grant, buffers.map(_.out.bits))
  buffers.zip(arbiter.io.grant.asBools).foreach { case (buffer, isGranted) =>
    buffer.out.ready := isGranted && rows.ready
  }

  private val compositor = io.photo.map { photo =>
    val compositor = Module(new PhotoCompositor(config, shell))
    compositor.io.settings := io.settings
    compositor.io.rows :<>= rows
    photo :<>= compositor.io.axi
    compositor
  }
  private val written = compositor.fold(rows)(_.io.out)
  bursts.io.rows :<>= written
  private val streamer = io.stream.map { stream =>
    val streamer = Module(new RowStreamer(config, shell))
    streamer.format      := io.settings.format
    streamer.rows.bits   := written.bits
    streamer.rows.valid  := written.valid && io.settings.toStream
    bursts.io.rows.valid := written.valid && !io.settings.toStream
    written.ready        := Mux(io.settings.toStream, streamer.rows.ready, bursts.io.rows.ready)
    stream :<>= streamer.out
    streamer
  }
  bursts.io.settings := io.settings
  bursts.io.drop     := io.errors.response
  io.axi :<>= bursts.io.axi

  private def sticky(event: Bool): Bool = {
    val isSet = RegInit(false.B)
    isSet := event || (isSet && !io.clearErrors)
    isSet
  }
  io.errors.window        := sticky(bursts.io.isOutside)
  io.errors.response      := sticky(io.axi.b.fire && io.axi.b.bits.resp =/= 0.U)
  io.errors.photoWindow   := compositor.fold(false.B)(unit => sticky(unit.io.isOutside))
  io.errors.photoResponse := compositor.fold(false.B)(unit => sticky(unit.io.isError))
  io.isIdle               := encoders.map(_.isIdle).reduce(_ && _) && buffers.map(_.isIdle).reduce(_ && _) &&
    compositor.fold(true.B)(_.io.isIdle) && bursts.io.isIdle && streamer.fold(true.B)(_.isIdle)
}
