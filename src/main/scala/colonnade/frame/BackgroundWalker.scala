package colonnade.frame

import chisel3._
import chisel3.util.{Arbiter, Decoupled}
import colonnade.common.TimingSlice
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameRegisters, FrameSettings, Pixel, PixelHit, PixelPosition, Rgb}

final class BackgroundWalkerIO(config: ColonnadeConfig) extends Bundle {
  val frame  = Input(new FrameSettings(config.numbers))
  val colour = Input(Rgb(FrameRegisters.colour))
  val tiles  = Flipped(Decoupled(new Tile(config)))

  /** Background pixels of tiles of other kinds, by priority. */
  val others = Vec(TileKind.all(config).size - 1, Flipped(Decoupled(new PixelPosition(config))))

  /** Pixels of `others`, and of the own tiles. */
  val rejected = Decoupled(new Pixel(config))
  val pixels   = Decoupled(new Pixel(config))

  val isIdle = Output(Bool()) // no pixel of a tile is left
}

/** Colours the pixels that show the background, in parallel with the path tracer: all pixels of its own tiles, and those
  * that the column's [[TileWalker]] and [[EnvironmentWalker]] reject. Throughput: one pixel per cycle of either.
  */
final class BackgroundWalker(config: ColonnadeConfig) extends Module {
  val io = IO(new BackgroundWalkerIO(config))

  private val scan   = Module(new TileScan(config))
  private val others = Module(new Arbiter(new PixelPosition(config), io.others.size))
  scan.io.frame     := io.frame
  scan.io.isDivided := false.B
  scan.io.tiles <> io.tiles
  others.io.in.zip(io.others).foreach { case (in, positions) => in <> positions }

  private val own = TimingSlice.queue(scan.io.positions)
  for ((pixels, positions) <- Seq(io.rejected -> others.io.out, io.pixels -> own)) {
    pixels.valid         := positions.valid
    pixels.bits.x        := positions.bits.x
    pixels.bits.y        := positions.bits.y
    pixels.bits.colour   := io.colour
    pixels.bits.isObject := false.B
    pixels.bits.ratio.foreach(_.channels.foreach(_ := FrameRegisters.one))
    pixels.bits.hit.foreach(_ := 0.U.asTypeOf(new PixelHit(config)))
    positions.ready := pixels.ready
  }
  io.isIdle := scan.io.isIdle && !own.valid
}
