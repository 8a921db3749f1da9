package colonnade.environment

import chisel3._
import chisel3.util.random.LFSR
import chisel3.util.{Counter, Decoupled, Fill, Queue, RegEnable}

/** Delays requests to an environment's maps, and their responses, at random. Without a valid response the port has noise,
  * as it has the responses of other requesters in an array.
  */
object SlowMaps {

  /** @param requester has at most 16 requests in flight in each channel */
  def connect(requester: AttributePort, maps: AttributePort, isSlow: Bool): Unit = {
    // Each channel stops for single cycles, and for 16 together, so that it falls behind the others
    val noise                 = LFSR(16)
    val (_, ends)             = Counter(true.B, 16)
    val stops                 = RegEnable(noise, 0.U, ends)
    def holds(bit: Int): Bool = isSlow && (noise(bit) || stops(bit))
    join(requester.cells, maps.cells, holds(0), noise)
    join(requester.planes, maps.planes, holds(5), noise)
    join(requester.albedo, maps.albedo, holds(9), noise)
    join(requester.normals, maps.normals, holds(3), noise)
  }

  private def join[Q <: Data, R <: Data](
      requester: AttributeChannel[Q, R],
      map:       AttributeChannel[Q, R],
      holds:     Bool,
      noise:     UInt
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
    val bits  = waiting.bits.asUInt
    val other = Fill(bits.getWidth / noise.getWidth + 1, noise)(bits.getWidth - 1, 0)
    requester.resp.bits := Mux(waiting.fire, bits, other).asTypeOf(requester.resp.bits)
  }
}
