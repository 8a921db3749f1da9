package colonnade.environment

import chisel3._
import chisel3.util.random.LFSR
import chisel3.util.{Counter, Decoupled, Queue, RegEnable}

/** Delays requests to an environment's maps, and their responses, at random. */
object SlowMaps {

  /** @param requester has at most 16 requests in flight in each channel */
  def connect(requester: AttributePort, maps: AttributePort, isSlow: Bool): Unit = {
    // Each channel stops for single cycles, and for 16 together, so that it falls behind the others
    val noise                 = LFSR(16)
    val (_, ends)             = Counter(true.B, 16)
    val stops                 = RegEnable(noise, 0.U, ends)
    def holds(bit: Int): Bool = isSlow && (noise(bit) || stops(bit))
    join(requester.cells, maps.cells, holds(0))
    join(requester.planes, maps.planes, holds(5))
    join(requester.albedo, maps.albedo, holds(9))
    join(requester.normals, maps.normals, holds(3))
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
    val waiting = Queue(responses, 16, flow = true)
    waiting.ready        := !holds
    requester.resp.valid := waiting.fire
    requester.resp.bits  := waiting.bits
  }
}
