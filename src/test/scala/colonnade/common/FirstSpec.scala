package colonnade.common

import chisel3._
import chisel3.util.PopCount
import chiseltest._
import colonnade.Proofs
import org.scalatest.flatspec.AnyFlatSpec

/** Any claims that last until they are served, which may be at any time. */
class RegisteredFirstProof(count: Int) extends Module {
  val claims   = IO(Input(UInt(count.W)))
  val isServed = IO(Input(Bool()))

  private val choice = First.registered(claims.asBools, isServed)
  private val now    = choice.now
  private val served = VecInit((0 until count).map(i => now.valid && isServed && now.bits === i.U)).asUInt

  /** Claims before this cycle that are not served yet. */
  private val waiting = RegInit(0.U(count.W))
  waiting := claims & (~served).asUInt
  assume((waiting & (~claims).asUInt) === 0.U, "a claim lasts until it is served")

  assert(!now.valid || waiting(now.bits), "each claim is served once, and nothing else")
  assert(now.valid === waiting.orR, "a claim does not wait while nothing else is chosen")
  private val following = RegNext(choice.following, 0.U.asTypeOf(choice.following))
  assert(now.valid === following.valid, "the choice is known before")
  assert(!now.valid || now.bits === following.bits, "the choice is the one known before")
  private val stays = RegNext(now.valid && !isServed, false.B)
  assert(!stays || (now.valid && now.bits === RegNext(now.bits)), "a choice stays until it is served")

  cover(PopCount(waiting) === count.U, "all wait")
  cover(now.valid && now.bits === (count - 1).U && RegNext(now.valid && now.bits === 0.U && isServed, false.B))
  cover(stays && isServed, "a choice has to wait")
}

class FirstSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "First.registered"

  for (count <- Seq(2, 3, 6))
    it should s"serve each of $count claims once" in
      prove(new RegisteredFirstProof(count))
}
