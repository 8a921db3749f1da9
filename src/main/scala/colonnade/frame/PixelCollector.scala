package colonnade.frame

import chisel3._
import chisel3.util.{Decoupled, Mux1H, Queue}
import colonnade.common.RoundRobin
import colonnade.config.ColonnadeConfig
import colonnade.formats.Pixel

/** Ports of [[PixelCollector]]. */
final class PixelCollectorIO(config: ColonnadeConfig, count: Int) extends Bundle {
  val sources = Vec(count, Flipped(Decoupled(new Pixel(config))))
  val pixels  = Decoupled(new Pixel(config))
}

/** Joins the pixels of `count` sources, a column's render units and its background, in one stream: one a cycle, a cycle later, from the sources in turn.
  * Pixels of one source stay in order.
  */
final class PixelCollector(config: ColonnadeConfig, count: Int) extends Module {
  val io = IO(new PixelCollectorIO(config, count))

  private val turn   = Module(new RoundRobin(count))
  private val chosen = Wire(Decoupled(new Pixel(config)))
  turn.io.requests := VecInit(io.sources.map(_.valid)).asUInt
  turn.io.isTaken  := chosen.fire

  chosen.valid := turn.io.requests.orR
  chosen.bits  := Mux1H(turn.io.grant, io.sources.map(_.bits))
  io.sources.zip(turn.io.grant.asBools).foreach { case (source, isGranted) =>
    source.ready := chosen.ready && isGranted
  }
  io.pixels <> Queue(chosen, 2)
}
