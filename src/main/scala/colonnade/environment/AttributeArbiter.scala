package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Mux1H, OHToUInt, Pipe, Queue}
import colonnade.common.RoundRobin

final class AttributeArbiterIO[Q <: Data, R <: Data](request: Q, response: R, count: Int, tagBits: Int) extends Bundle {
  val requesters = Vec(count, Flipped(new AttributeChannel(request, response, tagBits)))

  /** A tag here is a requester's number above its own tag. */
  val joined = new AttributeChannel(request, response, AttributeArbiter.tagBits(count, tagBits))
}

/** Joins the channels of several requesters by round-robin, or the last one first. A response goes to all of them and is valid for the requester
  * that its tag names.
  *
  * One request a cycle. Requests and responses pass one register each, so that arbiters can form trees of any size.
  *
  * @param lastFirst the last requester goes before the others; it leaves cycles to them
  */
final class AttributeArbiter[Q <: Data, R <: Data](
    request:   Q,
    response:  R,
    count:     Int,
    tagBits:   Int,
    lastFirst: Boolean = false
) extends Module {
  val io = IO(new AttributeArbiterIO(request, response, count, tagBits))

  // Grant a requester
  private val reqs    = io.requesters.map(_.req)
  private val others  = if (lastFirst) reqs.init else reqs
  private val isFirst = lastFirst.B && reqs.last.valid
  private val arbiter = Module(new RoundRobin(others.size))
  private val granted = Wire(Decoupled(chiselTypeOf(io.joined.req.bits)))
  private val grant   = arbiter.io.grant.asBools.map(_ && !isFirst) ++ Option.when(lastFirst)(isFirst)
  private val bits    = Mux1H(grant, reqs.map(_.bits))
  arbiter.io.requests  := VecInit(others.map(_.valid)).asUInt
  arbiter.io.isTaken   := granted.fire && !isFirst
  granted.valid        := reqs.map(_.valid).reduce(_ || _)
  granted.bits.content := bits.content
  granted.bits.tag     := (if (count == 1) bits.tag else OHToUInt(grant) ## bits.tag)
  io.joined.req <> Queue(granted)
  for ((req, isGranted) <- reqs.zip(grant)) req.ready := isGranted && granted.ready

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
