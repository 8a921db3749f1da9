package colonnade.environment

import chisel3._

/** A requester of a channel of the maps, at most one request in flight. A request may be made before it is known that
  * its response is needed: the response is stored until a step takes it, or until it is dropped.
  *
  * @param keep the part of a response that is stored
  */
final class Lookahead[Q <: Data, R <: Data, K <: Data](channel: AttributeChannel[Q, R], keep: TaggedResponse[R] => K) {
  private val isIssued = RegInit(false.B) // not yet accepted
  private val inFlight = RegInit(false.B)
  private val isStale  = RegInit(false.B) // the response in flight is dropped

  /** The last request. */
  val request: Q = Reg(chiselTypeOf(channel.req.bits.content))

  /** A response is stored, and which one. */
  val isStored: Bool = RegInit(false.B)
  val stored:   K    = Reg(chiselTypeOf(keep(channel.resp.bits)))

  /** The response of the last request comes in this cycle. */
  val arrives: Bool = channel.resp.valid && !isStale

  /** The last request's response can be taken. */
  val isAvailable: Bool = isStored || arrives
  val response:    K    = Mux(isStored, stored, keep(channel.resp.bits))

  /** No request waits or is in flight, so one can be made. */
  val isFree: Bool = !isIssued && !inFlight

  /** The last request is not yet taken, nor dropped. */
  val isPending: Bool = isIssued || (inFlight && !isStale) || isStored

  channel.req.valid        := isIssued
  channel.req.bits.tag     := 0.U
  channel.req.bits.content := request
  when(channel.req.fire) {
    isIssued := false.B
    inFlight := true.B
  }
  when(channel.resp.valid) {
    inFlight := false.B
    isStale  := false.B
    isStored := !isStale
    stored   := keep(channel.resp.bits)
  }

  /** Makes a request. Only in a cycle in which one can be made, or with [[take]]. */
  def make(content: Q => Unit): Unit = {
    content(request)
    isIssued := true.B
    isStored := false.B
  }

  /** Takes the response, which is available. */
  def take(): Unit = isStored := false.B

  /** Drops the last request. */
  def drop(): Unit = {
    isIssued := false.B
    isStored := false.B
    isStale  := channel.req.fire || (inFlight && !channel.resp.valid)
  }
}
