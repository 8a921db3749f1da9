package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Mux1H, OHToUInt, Pipe, Queue}
import colonnade.common.RoundRobin

/** Ports of [[AttributeArbiter]]. */
final class AttributeArbiterIO[Q <: Data, A <: Data](question: Q, answer: A, count: Int, tagBits: Int) extends Bundle {
  val requesters = Vec(count, Flipped(new AttributeChannel(question, answer, tagBits)))

  /** A tag here is a requester's number above its own tag. */
  val served = new AttributeChannel(question, answer, AttributeArbiter.tagBits(count, tagBits))
}

/** Joins the channels of several requesters, in turn; an answer goes to all and is valid for the one that asked.
  *
  * One question a cycle. Questions and answers pass a register each, so that arbiters make trees of any size.
  */
final class AttributeArbiter[Q <: Data, A <: Data](question: Q, answer: A, count: Int, tagBits: Int) extends Module {
  val io = IO(new AttributeArbiterIO(question, answer, count, tagBits))

  // Choose a requester
  private val turn   = Module(new RoundRobin(count))
  private val asking = io.requesters.map(_.question)
  private val chosen = Wire(Decoupled(chiselTypeOf(io.served.question.bits)))
  private val asked  = Mux1H(turn.io.grant, asking.map(_.bits))
  turn.io.requests    := VecInit(asking.map(_.valid)).asUInt
  turn.io.isTaken     := chosen.fire
  chosen.valid        := asking.map(_.valid).reduce(_ || _)
  chosen.bits.content := asked.content
  chosen.bits.tag     := (if (count == 1) asked.tag else OHToUInt(turn.io.grant) ## asked.tag)
  io.served.question <> Queue(chosen)
  asking.zip(turn.io.grant.asBools).foreach { case (question, isGranted) =>
    question.ready := isGranted && chosen.ready
  }

  // Show the answer to everybody
  private val shown = Pipe(io.served.answer)
  for ((requester, number) <- io.requesters.zipWithIndex) {
    requester.answer.valid := shown.valid && shown.bits.tag >> tagBits === number.U
    requester.answer.bits  := shown.bits
  }
}

object AttributeArbiter {

  /** Of the joined channel. */
  def tagBits(requesters: Int, tagBits: Int): Int = tagBits + log2Ceil(requesters)
}
