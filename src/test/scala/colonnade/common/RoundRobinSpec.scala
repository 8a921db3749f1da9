package colonnade.common

import chisel3._
import chisel3.util.PopCount
import chiseltest._
import colonnade.Proofs
import org.scalatest.flatspec.AnyFlatSpec

/** Any requests, with grants accepted at any time. */
class RoundRobinProof(count: Int) extends Module {
  val requests = IO(Input(UInt(count.W)))
  val isTaken  = IO(Input(Bool()))

  private val arbiter = Module(new RoundRobin(count))
  arbiter.io.requests := requests
  arbiter.io.isTaken  := isTaken
  private val grant = arbiter.io.grant

  assert((grant & ~requests) === 0.U, "a grant without a request")
  assert(PopCount(grant) === requests.orR.asUInt, "one grant when there is a request")

  for (i <- 0 until count) {
    val waited = RegInit(0.U(3.W))
    when(!requests(i) || (isTaken && grant(i))) {
      waited := 0.U
    }.elsewhen(isTaken) { waited := waited + 1.U }
    assert(waited < count.U, "nobody waits for more than the others")
    cover(waited === (count - 1).U && isTaken && grant(i), "served after all others")
  }
}

class RoundRobinSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "RoundRobin"

  for (count <- Seq(1, 2, 3)) {
    it should s"grant one request and starve none of $count" in {
      prove(new RoundRobinProof(count))
    }
  }
}
