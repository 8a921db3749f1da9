package colonnade.common

import chisel3._
import chisel3.util.{Decoupled, PopCount}
import chiseltest._
import colonnade.Proofs
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

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

/** Any items at any time, taken at any time. */
class MergerProof(count: Int) extends Module {
  val givers = IO(Flipped(Vec(count, Decoupled(UInt(2.W)))))
  val items  = IO(Decoupled(UInt(2.W)))

  private val merger = Module(new Merger(UInt(2.W), count)).io
  merger.givers :<>= givers
  items :<>= merger.items

  private val gives = VecInit(givers.map(_.fire)).asUInt
  assert(items.valid === VecInit(givers.map(_.valid)).asUInt.orR, "an item when there is one")
  assert(PopCount(gives) === items.fire.asUInt, "each item is of one stream")

  for (giver <- givers) {
    when(giver.fire) { assert(items.bits === giver.bits, "the item of the stream that gives") }
    val waited = RegInit(0.U(3.W))
    when(giver.fire || !giver.valid) { waited := 0.U }.elsewhen(items.fire) { waited := waited + 1.U }
    assert(waited < count.U, "nobody waits for more than the others")
  }
}

class MergerSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "Merger"

  for (count <- Seq(1, 2, 3)) {
    it should s"give each item of $count streams once, and starve none" in {
      prove(new MergerProof(count))
    }
  }
}

class DelayLineSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "DelayLine"

  for (delay <- Seq(2, 3, 8))
    it should s"give each value $delay moves later, and hold it while the pipeline stalls" in {
      val random = new Random(delay)
      test(new DelayLine(UInt(16.W), delay)) { dut =>
        var stages =
          Vector.fill(delay)(Option.empty[Int]) // what was written with the last moves; the last one is out
        for (_ <- 0 until 2000) {
          stages.last.foreach(dut.io.out.expect(_))
          val value = Option.when(random.nextInt(3) > 0)(random.nextInt(1 << 16))
          val moves = random.nextInt(3) > 0
          dut.io.moves.poke(moves)
          dut.io.writes.poke(value.isDefined)
          dut.io.in.poke(value.getOrElse(0))
          dut.io.reads.poke(stages(delay - 2).isDefined)
          dut.clock.step()
          if (moves) stages = value +: stages.init
        }
      }
    }
}
