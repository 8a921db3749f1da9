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

  /** Background pixels of tiles of other kinds, by priority; they go before those of its own tiles. */
  val others = Vec(TileKind.all(config).size - 1, Flipped(Decoupled(new PixelPosition(config))))
  val pixels = Decoupled(new Pixel(config))

  val isIdle = Output(Bool()) // no pixel of a tile is left
}

/** Colours the pixels that show the background, in parallel with the path tracer: all pixels of its own tiles, and those
  * that the column's [[TileWalker]] and [[EnvironmentWalker]] reject. Throughput: one pixel per cycle.
  */
final class BackgroundWalker(config: ColonnadeConfig) extends Module {
  val io = IO(new BackgroundWalkerIO(config))

  private val scan      = Module(new TileScan(config))
  private val positions = Module(new Arbiter(new PixelPosition(config), io.others.size + 1))
  scan.io.frame     := io.frame
  scan.io.isDivided := false.B
  scan.io.tiles <> io.tiles

  private val own = TimingSlice.queue(scan.io.positions)
  positions.io.in.zip(io.others :+ own).foreach { case (in, positions) => in <> positions }

  io.pixels.valid         := positions.io.out.valid
  io.pixels.bits.x        := positions.io.out.bits.x
  io.pixels.bits.y        := positions.io.out.bits.y
  io.pixels.bits.colour   := io.colour
  io.pixels.bits.isObject := false.B
  io.pixels.bits.ratio.foreach(_.channels.foreach(_ := FrameRegisters.one))
  io.pixels.bits.hit.foreach(_ := 0.U.asTypeOf(new PixelHit(config)))
  positions.io.out.ready := io.pixels.ready
  io.isIdle              := scan.io.isIdle && !own.valid
}
