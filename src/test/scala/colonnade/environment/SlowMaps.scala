package colonnade.environment

import chisel3._
import chisel3.util.random.LFSR
import chisel3.util.{Decoupled, Queue}

/** Delays requests to an environment's maps, and their responses, at random. */
object SlowMaps {

  /** @param requester has at most eight requests in flight in each channel */
  def connect(requester: AttributePort, maps: AttributePort, isSlow: Bool): Unit = {
    val noise = LFSR(16)
    join(requester.cells, maps.cells, isSlow && noise(0))
    join(requester.planes, maps.planes, isSlow && noise(5))
    join(requester.albedo, maps.albedo, isSlow && noise(9))
    join(requester.normals, maps.normals, isSlow && noise(3))
  }

  private def join[Q <: Data, R <: Data](
      requester: AttributeChannel[Q, R],
      map:       AttributeChannel[Q, R],
      holds:     Bool
  ): Unit = {
    map.req.valid       := requester.req.valid && !holds
    map.req.bits        := requester.req.bits
    requester.req.ready := map.req.ready && !holds

    val responses = Wire(Decoupled(chiselTypeOf(map.resp.bits)))
    responses.valid := map.resp.valid
    responses.bits  := map.resp.bits
    val waiting = Queue(responses, 8, flow = true)
    waiting.ready        := !holds
    requester.resp.valid := waiting.fire
    requester.resp.bits  := waiting.bits
  }
}
