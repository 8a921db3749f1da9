package colonnade.common

import chisel3._

/** Ports of [[RoundRobin]]; bit i belongs to requester i. */
final class RoundRobinIO(count: Int) extends Bundle {
  val requests = Input(UInt(count.W))
  val grant    = Output(UInt(count.W)) // one of the requests, one-hot; 0 without requests
  val isTaken  = Input(Bool())         // the grant is accepted: this requester now has the lowest priority
}

/** A round-robin arbiter: a requester that stays valid gets one of the next `count` accepted grants.
  *
  * Combinational from request to grant. Requests may be withdrawn; the grant follows them until it is accepted.
  */
final class RoundRobin(count: Int) extends Module {
  val io = IO(new RoundRobinIO(count))

  // Requesters after the last one granted have priority over the others.
  private val after = RegInit(0.U(count.W))
  private val ahead = io.requests & after

  io.grant := lowest(Mux(ahead.orR, ahead, io.requests))
  when(io.isTaken && io.grant.orR) { after := above(io.grant) }

  private def lowest(bits: UInt): UInt = bits & (0.U - bits)

  private def above(oneHot: UInt): UInt = ~((oneHot << 1).asUInt - 1.U)(count - 1, 0)
}
