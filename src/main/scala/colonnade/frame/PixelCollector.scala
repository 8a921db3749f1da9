package colonnade.frame

import chisel3._
import chisel3.util.{log2Ceil, Arbiter, Decoupled, Queue}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Pixel, PixelPosition, UnitPosition}

final class PixelCollectorIO(config: ColonnadeConfig, count: Int) extends Bundle {
  val sources = Vec(count, Flipped(Decoupled(new Pixel(config)))) // by priority
  val pixels  = Decoupled(new Pixel(config))
}

/** Merges the pixels of `count` sources of a column into one stream, the first offering source first.
  *
  * Throughput: one pixel per cycle. Latency: one cycle. Pixels of one source stay in order.
  */
final class PixelCollector(config: ColonnadeConfig, count: Int) extends Module {
  val io = IO(new PixelCollectorIO(config, count))

  private val arbiter = Module(new Arbiter(new Pixel(config), count)).io
  arbiter.in.zip(io.sources).foreach { case (in, source) => in <> source }
  io.pixels <> Queue(arbiter.out, 2)
}

final class PixelMixerIO(config: ColonnadeConfig) extends Bundle {

  /** Pixels of a tile that may show the object, and of one that shows the environment only. */
  val objects     = Flipped(Decoupled(new UnitPosition(config)))
  val environment = Flipped(Decoupled(new PixelPosition(config)))
  val positions   = Decoupled(new UnitPosition(config))

  val leaves = Input(Bool()) // a pixel of `environment` has left the column
}

/** Mixes the pixels of two tiles: the environment's use units that the object's leave idle, and the other
  * way round. Combinational, one pixel per cycle.
  *
  * @param maxEnvironment pixels of the environment go first while fewer of them are in flight, and wait otherwise
  */
final class PixelMixer(config: ColonnadeConfig, maxEnvironment: Int) extends Module {
  val io = IO(new PixelMixerIO(config))

  private val inFlight = RegInit(0.U(log2Ceil(maxEnvironment + 1).W))
  inFlight := inFlight + io.environment.fire - io.leaves
  private val isEnvironment = io.environment.valid && inFlight =/= maxEnvironment.U
  io.objects.ready     := io.positions.ready && !isEnvironment
  io.environment.ready := io.positions.ready && isEnvironment

  io.positions.valid := io.objects.valid || isEnvironment
  io.positions.bits  := io.objects.bits
  when(isEnvironment) {
    io.positions.bits.x               := io.environment.bits.x
    io.positions.bits.y               := io.environment.bits.y
    io.positions.bits.meetsObject.get := false.B
  }
  io.positions.bits.inObjectTile.get := !isEnvironment
}
