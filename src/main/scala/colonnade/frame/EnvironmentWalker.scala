package colonnade.frame

import chisel3._
import chisel3.util.Decoupled
import colonnade.common.TimingSlice
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameSettings, PixelPosition}

final class EnvironmentWalkerIO(config: ColonnadeConfig) extends Bundle {
  val frame  = Input(new FrameSettings(config.numbers))
  val window = Input(new EnvironmentWindow(config))
  val tiles  = Flipped(Decoupled(new Tile(config)))

  /** Pixels that show the environment, and pixels that show the background. */
  val positions = Decoupled(new PixelPosition(config))
  val others    = Decoupled(new PixelPosition(config))

  val isIdle = Output(Bool()) // no pixel of a tile is left
}

/** Walks the tiles that show the environment and not the object, and sorts out their pixels outside the window.
  *
  * Throughput: one pixel per cycle. Combinational behind the queue of its [[TileScan]].
  */
final class EnvironmentWalker(config: ColonnadeConfig) extends Module {
  val io = IO(new EnvironmentWalkerIO(config))

  private val scan = Module(new TileScan(config))
  scan.io.frame     := io.frame
  scan.io.isDivided := false.B
  scan.io.tiles <> io.tiles

  private val position = TimingSlice.queue(scan.io.positions)
  private val inWindow = io.window.meets(position.bits, size = 1)
  position.ready     := Mux(inWindow, io.positions.ready, io.others.ready)
  io.positions.valid := position.valid && inWindow
  io.positions.bits  := position.bits
  io.others.valid    := position.valid && !inWindow
  io.others.bits     := position.bits
  io.isIdle          := scan.io.isIdle && !position.valid
}
