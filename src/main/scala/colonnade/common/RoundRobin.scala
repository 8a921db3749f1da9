package colonnade.common

import chisel3._

/** Ports of [[RoundRobin]]; bit i is requester i. */
final class RoundRobinIO(count: Int) extends Bundle {
  val requests = Input(UInt(count.W))

  /** One of the requests, or none when there is none. */
  val grant = Output(UInt(count.W))

  /** The granted one has been served: it is now the last in line. */
  val isTaken = Input(Bool())
}

/** Grants one of several requesters, in turn: of `count` grants taken, one is that of a requester that keeps asking.
  *
  * Combinational from request to grant. Requests may come and go; a grant follows them while it is not taken.
  */
final class RoundRobin(count: Int) extends Module {
  val io = IO(new RoundRobinIO(count))

  // Requesters after the last one served; those up to it wait until none of these asks.
  private val after = RegInit(0.U(count.W))
  private val ahead = io.requests & after

  io.grant := lowest(Mux(ahead.orR, ahead, io.requests))
  when(io.isTaken && io.grant.orR) { after := above(io.grant) }

  private def lowest(bits: UInt): UInt = bits & (0.U - bits)

  private def above(oneHot: UInt): UInt = ~((oneHot << 1).asUInt - 1.U)(count - 1, 0)
}
