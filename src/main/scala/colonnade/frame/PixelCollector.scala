package colonnade.frame

import chisel3._
import chisel3.util.{Arbiter, Decoupled, Queue}
import colonnade.config.ColonnadeConfig
import colonnade.formats.Pixel

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
