package colonnade.frame

import chisel3._
import chisel3.util.{Decoupled, Mux1H, Queue}
import colonnade.common.RoundRobin
import colonnade.config.ColonnadeConfig
import colonnade.formats.Pixel

final class PixelCollectorIO(config: ColonnadeConfig, count: Int) extends Bundle {
  val sources = Vec(count, Flipped(Decoupled(new Pixel(config))))
  val pixels  = Decoupled(new Pixel(config))
}

/** Merges the pixels of `count` sources, a column's path tracer and its background, into one stream, round-robin.
  *
  * Throughput: one pixel per cycle. Latency: one cycle. Pixels of one source stay in order.
  */
final class PixelCollector(config: ColonnadeConfig, count: Int) extends Module {
  val io = IO(new PixelCollectorIO(config, count))

  private val arbiter  = Module(new RoundRobin(count))
  private val selected = Wire(Decoupled(new Pixel(config)))
  arbiter.io.requests := VecInit(io.sources.map(_.valid)).asUInt
  arbiter.io.isTaken  := selected.fire

  selected.valid := arbiter.io.requests.orR
  selected.bits  := Mux1H(arbiter.io.grant, io.sources.map(_.bits))
  io.sources.zip(arbiter.io.grant.asBools).foreach { case (source, isGranted) =>
    source.ready := selected.ready && isGranted
  }
  io.pixels <> Queue(selected, 2)
}
