package colonnade.query

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Queue, Valid}
import colonnade.axi.Axi
import colonnade.common.Context
import colonnade.config.PathConfig

/** Where a run's hits go. */
final class PlacedRun extends Bundle {
  val hits   = UInt(Axi.addressBits.W)
  val count  = UInt(log2Ceil(Run.rays + 1).W)
  val isTile = Bool()
}

/** A ray that takes a context. */
final class IssuedRay extends Bundle {
  val isLast    = Bool() // of its run
  val hasFailed = Bool() // its run is dropped
}

/** The ray whose tables are read. */
final class EndedRay extends Bundle {
  val run     = new PlacedRun
  val index   = UInt(log2Ceil(Run.rays).W) // in the run
  val isLast  = Bool()
  val isFirst = Bool()
  val drops   = Bool()                     // the run has no hits
}

final class RayRingIO(config: PathConfig) extends Bundle {
  val runs   = Flipped(Decoupled(new PlacedRun))
  val issued = Flipped(Valid(new IssuedRay)) // its context is `next`, if there is one
  val next   = Valid(Context(config))
  val ends   = Vec(2, Flipped(Valid(Context(config))))

  /** Tables to read in this cycle, for the ray that is offered in the next one. */
  val read = Valid(Context(config))
  val rays = Decoupled(new EndedRay)
}

/** Contexts in the order of rays, which end in any order. A ray takes the next context of the ring, and gives it back
  * when it is the oldest one, has ended, and is taken; rays of a run are offered when each of them has a context.
  *
  * Throughput: a ray a cycle, and a cycle between runs. A ray that is not taken is read again.
  */
final class RayRing(config: PathConfig) extends Module {
  val io = IO(new RayRingIO(config))

  private val contexts = config.contexts
  private val slots    = contexts / Run.rays + RayRing.aheadRuns
  private val accepted = Module(new Queue(new PlacedRun, slots)).io
  private val complete = Module(new Queue(Bool(), slots)).io // runs whose rays have contexts; whether one has failed
  accepted.enq :<>= io.runs

  // Take contexts
  private val newest    = RegInit(0.U(log2Ceil(contexts).W))
  private val inFlight  = RegInit(0.U(log2Ceil(contexts + 1).W))
  private val hasFailed = RegInit(false.B) // a ray of the run
  private val fails     = hasFailed || io.issued.bits.hasFailed
  io.next.valid      := inFlight =/= contexts.U
  io.next.bits       := newest
  complete.enq.valid := io.issued.valid && io.issued.bits.isLast
  complete.enq.bits  := fails
  when(io.issued.valid) {
    newest    := newest + 1.U
    hasFailed := fails && !io.issued.bits.isLast
  }
  assert(!complete.enq.valid || complete.enq.ready, "more runs than are accepted")

  // Give them back
  private val hasEnded = RegInit(VecInit.fill(contexts)(false.B))
  private val oldest   = RegInit(0.U(log2Ceil(contexts).W))
  private val index    = RegInit(0.U(log2Ceil(Run.rays).W))
  private val offers   = RegInit(false.B)
  private val after    = oldest + 1.U
  private val taken    = io.rays.fire
  private val isLast   = index +& 1.U === accepted.deq.bits.count
  io.read.valid := complete.deq.valid && Mux(taken, !isLast && hasEnded(after), hasEnded(oldest))
  io.read.bits  := Mux(taken, after, oldest)
  offers        := io.read.valid
  for (end <- io.ends) when(end.valid) { hasEnded(end.bits) := true.B }
  when(taken) {
    oldest           := after
    hasEnded(oldest) := false.B
    index            := Mux(isLast, 0.U, index + 1.U)
  }
  inFlight             := inFlight + io.issued.valid - taken
  io.rays.valid        := offers
  io.rays.bits.run     := accepted.deq.bits
  io.rays.bits.index   := index
  io.rays.bits.isFirst := index === 0.U
  io.rays.bits.isLast  := isLast
  io.rays.bits.drops   := complete.deq.bits
  accepted.deq.ready   := taken && isLast
  complete.deq.ready   := taken && isLast
}

object RayRing {

  /** Runs that are accepted before their rays have contexts. */
  val aheadRuns: Int = 4
}
