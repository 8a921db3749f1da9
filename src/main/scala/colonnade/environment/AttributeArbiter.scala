package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Mux1H, OHToUInt, Pipe, Queue}
import colonnade.common.RoundRobin

final class AttributeArbiterIO[Q <: Data, R <: Data](request: Q, response: R, count: Int, tagBits: Int) extends Bundle {
  val requesters = Vec(count, Flipped(new AttributeChannel(request, response, tagBits)))

  /** A tag here is a requester's number above its own tag. */
  val joined = new AttributeChannel(request, response, AttributeArbiter.tagBits(count, tagBits))
}

/** Joins the channels of several requesters by round-robin. A response goes to all of them and is valid for the requester
  * that its tag names.
  *
  * One request a cycle. Requests and responses pass one register each, so that arbiters can form trees of any size.
  */
final class AttributeArbiter[Q <: Data, R <: Data](request: Q, response: R, count: Int, tagBits: Int) extends Module {
  val io = IO(new AttributeArbiterIO(request, response, count, tagBits))

  // Grant a requester
  private val arbiter = Module(new RoundRobin(count))
  private val reqs    = io.requesters.map(_.req)
  private val granted = Wire(Decoupled(chiselTypeOf(io.joined.req.bits)))
  private val bits    = Mux1H(arbiter.io.grant, reqs.map(_.bits))
  arbiter.io.requests  := VecInit(reqs.map(_.valid)).asUInt
  arbiter.io.isTaken   := granted.fire
  granted.valid        := reqs.map(_.valid).reduce(_ || _)
  granted.bits.content := bits.content
  granted.bits.tag     := (if (count == 1) bits.tag else OHToUInt(arbiter.io.grant) ## bits.tag)
  io.joined.req <> Queue(granted)
  for ((req, isGranted) <- reqs.zip(arbiter.io.grant.asBools)) req.ready := isGranted && granted.ready

  // Broadcast the response
  private val broadcast = Pipe(io.joined.resp)
  for ((requester, number) <- io.requesters.zipWithIndex) {
    requester.resp.valid := broadcast.valid && broadcast.bits.tag >> tagBits === number.U
    requester.resp.bits  := broadcast.bits
  }
}

object AttributeArbiter {

  /** Bits of the joined channel's tag. */
  def tagBits(requesters: Int, tagBits: Int = 0): Int = tagBits + log2Ceil(requesters)
}
