package colonnade.frame

import chisel3._
import chisel3.util.Decoupled
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameRegisters, FrameSettings, Pixel, PixelHit, Rgb}

/** Ports of [[BackgroundWalker]]. */
final class BackgroundWalkerIO(config: ColonnadeConfig) extends Bundle {
  val frame  = Input(new FrameSettings(config.numbers))
  val colour = Input(Rgb(FrameRegisters.colour))
  val tiles  = Flipped(Decoupled(new Tile(config)))
  val pixels = Decoupled(new Pixel(config))

  /** No pixel is left. */
  val isIdle = Output(Bool())
}

/** The pixels of tiles that no ray to the object goes through: the background's colour, one a cycle, beside the render
  * units, which work on other tiles meanwhile.
  */
final class BackgroundWalker(config: ColonnadeConfig) extends Module {
  val io = IO(new BackgroundWalkerIO(config))

  private val scan = Module(new TileScan(config))
  scan.io.frame := io.frame
  scan.io.tiles <> io.tiles

  io.pixels.valid         := scan.io.positions.valid
  io.pixels.bits.x        := scan.io.positions.bits.x
  io.pixels.bits.y        := scan.io.positions.bits.y
  io.pixels.bits.colour   := io.colour
  io.pixels.bits.isObject := false.B
  io.pixels.bits.hit.foreach(_ := 0.U.asTypeOf(new PixelHit(config)))
  scan.io.positions.ready := io.pixels.ready
  io.isIdle               := scan.io.isIdle
}
