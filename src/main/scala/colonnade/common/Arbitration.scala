package colonnade.common

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Mux1H, Valid}

/** The claim that is granted now, and the one to be granted next, if known. */
final case class Choice(now: Valid[UInt], following: Valid[UInt])

object Choice {

  /** A choice that is not known before. */
  def apply(now: Valid[UInt]): Choice = Choice(now, 0.U.asTypeOf(now))
}

/** The lowest of some claims, as a tree whose depth is the logarithm of their number. */
object First {
  def apply(claims: Seq[Bool]): Valid[UInt] = {
    val (isAny, index) = lowest(claims.zipWithIndex.map { case (claim, index) => (claim, index.U) })
    val first          = Wire(Valid(UInt(log2Ceil(claims.size.max(2)).W)))
    first.valid := isAny
    first.bits  := index
    first
  }

  /** A registered choice, for so many claims that they need a cycle: it stays until `isServed`, and a claim is served
    * once. Claims must last until then.
    */
  def registered(claims: Seq[Bool], isServed: => Bool): Choice = {
    val chosen = RegInit(0.U.asTypeOf(Valid(UInt(log2Ceil(claims.size.max(2)).W))))
    val next   = First(claims.zipWithIndex.map { case (claim, index) =>
      claim && !(chosen.valid && chosen.bits === index.U)
    })
    val following = Mux(!chosen.valid || isServed, next, chosen)
    chosen := following
    Choice(chosen, following)
  }

  private def lowest(claims: Seq[(Bool, UInt)]): (Bool, UInt) =
    if (claims.size == 1) claims.head
    else {
      val ((low, lowIndex), (high, highIndex)) = {
        val (lower, upper) = claims.splitAt((claims.size + 1) / 2)
        (lowest(lower), lowest(upper))
      }
      (low || high, Mux(low, lowIndex, highIndex))
    }
}

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

final class DispatcherIO[T <: Data](private val item: T, count: Int) extends Bundle {
  val items  = Flipped(Decoupled(item))
  val takers = Vec(count, Decoupled(item)) // valid only where ready is set: ready must not depend on valid
}

/** Dispatches each item to one of the ready takers in round-robin order, so that consecutive items spread.
  *
  * Combinational; throughput one item per cycle.
  */
final class Dispatcher[T <: Data](item: T, count: Int) extends Module {
  val io = IO(new DispatcherIO(item, count))

  private val arbiter = Module(new RoundRobin(count))
  arbiter.io.requests := VecInit(io.takers.map(_.ready)).asUInt
  arbiter.io.isTaken  := io.items.fire

  io.items.ready := arbiter.io.requests.orR
  io.takers.zip(arbiter.io.grant.asBools).foreach { case (taker, isGranted) =>
    taker.valid := io.items.valid && isGranted
    taker.bits  := io.items.bits
  }
}

final class MergerIO[T <: Data](private val item: T, count: Int) extends Bundle {
  val givers = Flipped(Vec(count, Decoupled(item))) // ready depends on valid
  val items  = Decoupled(item)
}

/** Merges streams in round-robin order: a stream that stays valid gives one of the next `count` items.
  *
  * Combinational; throughput one item per cycle. Unlike Chisel's `RRArbiter`, it has a reset.
  */
final class Merger[T <: Data](item: T, count: Int) extends Module {
  val io = IO(new MergerIO(item, count))

  private val arbiter = Module(new RoundRobin(count)).io
  arbiter.requests := VecInit(io.givers.map(_.valid)).asUInt
  arbiter.isTaken  := io.items.fire

  io.items.valid := arbiter.requests.orR
  io.items.bits  := Mux1H(arbiter.grant, io.givers.map(_.bits))
  io.givers.zip(arbiter.grant.asBools).foreach { case (giver, isGranted) => giver.ready := isGranted && io.items.ready }
}
