package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Mux1H, PopCount, Queue, RegEnable, ShiftRegister}
import colonnade.common.Context
import colonnade.config.ColonnadeConfig
import colonnade.formats.{ChildKind, RecordFormats}
import colonnade.numbers.Fixed
import colonnade.ray.RayFormats

/** Ports of [[BoxUnit]]. */
final class BoxUnitIO(config: ColonnadeConfig) extends Bundle {
  val in = Flipped(Decoupled(new BoxCandidate(config)))

  /** `in` will be ready in the next cycle. */
  val takesNext = Output(Bool())
  val out       = Decoupled(new BoxResult(config))

  /** The datapath takes children in. */
  val busy = Output(Bool())
}

/** One ray against the children of one node (docs/numbers.md, section 3): which it enters, near to far, and where they
  * lie. Children of an illegal kind count as empty.
  *
  * `units.boxLanes` children a cycle: with two a node every cycle for arity 2, every second cycle for arity 4, in order.
  * Latency 5 cycles and one for each cycle of a node. The pipeline never stalls: as many nodes are let in as the queue
  * behind it can take, and that is enough for full speed. Relies on what the packer and ray set-up guarantee: a child's
  * planes are within two cubes of its node's corner, a ray's origin within half a cube of the object's cube, and a
  * reciprocal has no more digits than set-up computes.
  */
class BoxUnit(config: ColonnadeConfig) extends Module {
  private val arity = config.geometry.arity
  private val lanes = config.units.boxLanes
  private val beats = arity / lanes

  /** Nodes on their way from when one is let in to when its place is free again. */
  private val places = (BoxDatapath.latency + 2 + beats + beats - 1) / beats

  val io = IO(new BoxUnitIO(config))

  private val notes  = Module(new Queue(new BoxNote(config), places))
  private val orders = Module(new Queue(new ChildOrder(config), places))

  // Let a node in; its first children start at once, the others follow without a gap
  private val beat     = RegInit(0.U(log2Ceil(beats.max(2)).W))
  private val follows  = beat =/= 0.U
  private val nextBeat = Mux(io.in.fire || follows, Mux(beat === (beats - 1).U, 0.U, beat + 1.U), beat)
  beat               := nextBeat
  io.in.ready        := notes.io.enq.ready && !follows
  io.takesNext       := nextBeat === 0.U && notes.io.count +& io.in.fire - notes.io.deq.fire < places.U
  notes.io.enq.valid := io.in.fire
  notes.io.enq.bits  := BoxNote(config, io.in.bits)
  private val starts   = io.in.fire || follows
  private val endsNode = starts && beat === (beats - 1).U

  // Operands
  private val stored   = Seq.tabulate(arity)(BoxOperands.child(config, io.in.bits.node, _))
  private val heading  = io.in.bits.ray.heading
  private val waiting  = stored.map(RegEnable(_, io.in.fire))
  private val axis     = Mux(follows, RegEnable(heading.axis, io.in.fire), heading.axis)
  private val node     = RegEnable(BoxOperands.node(config, io.in.bits), io.in.fire)
  private val datapath = Module(new BoxDatapath(config, lanes))
  datapath.io.node := node
  for (lane <- 0 until lanes) {
    val turns    = (stored.take(lanes) ++ waiting.drop(lanes)).grouped(lanes).map(_(lane)).toSeq
    val child    = Mux1H(turns.zipWithIndex.map { case (child, turn) => (beat === turn.U) -> child })
    val negative = Seq.tabulate(3)(a => Mux(follows, node.negative(a), heading.negative(a)))
    datapath.io.children(lane) := RegEnable(BoxOperands.planes(config, child, axis, negative), starts)
  }

  // Collect the node's children and order them
  private val ends      = ShiftRegister(endsNode, BoxDatapath.latency + 1, false.B, true.B)
  private val isEntered = datapath.io.intervals.map(_.isEntered)
  private val near      = datapath.io.intervals.map(_.near)
  private def ofAllTurns[T <: Data](values: Seq[T]): Seq[T] =
    (0 until beats).reverse.flatMap(before => values.map(ShiftRegister(_, before)))
  orders.io.enq.valid := ends
  orders.io.enq.bits  := ChildOrder(config, ofAllTurns(isEntered), ofAllTurns(near))
  assert(!ends || orders.io.enq.ready, "a node was let in without a place for its result")

  io.out.valid        := orders.io.deq.valid
  orders.io.deq.ready := io.out.ready
  notes.io.deq.ready  := io.out.fire
  io.out.bits         := notes.io.deq.bits.result(orders.io.deq.bits)
  io.busy             := starts
}

/** What the result needs of a node beside the order of its children. */
private[traversal] final class BoxNote(config: ColonnadeConfig) extends Bundle {
  private val arity   = config.geometry.arity
  private val address = UInt(RecordFormats.addressBits(config).W)

  val context        = Context(config)
  val kinds          = Vec(arity, UInt(ChildKind.bits.W))
  val firstChild     = address.cloneType
  val firstTriangles = address.cloneType

  def result(order: ChildOrder): BoxResult = {
    val before = VecInit(kinds.indices.map(slot => PopCount(kinds.take(slot).map(_ === kinds(slot)) :+ false.B).pad(2)))
    val result = Wire(new BoxResult(config))
    result.context := context
    result.count   := order.count
    result.tests   := PopCount(kinds.map(BoxOperands.isOccupied))
    for ((child, entered) <- result.children.zip(order.children)) {
      val isLeaf = kinds(entered.slot) === ChildKind.leaf
      child.visit.isLeaf  := isLeaf
      child.visit.address := Mux(isLeaf, firstTriangles, firstChild) + before(entered.slot)
      child.near          := Fixed(new RayFormats(config.numbers).units, entered.near.zext)
    }
    result
  }
}

private[traversal] object BoxNote {
  def apply(config: ColonnadeConfig, candidate: BoxCandidate): BoxNote = {
    val note = Wire(new BoxNote(config))
    note.context        := candidate.context
    note.kinds          := candidate.node.kinds
    note.firstChild     := candidate.node.firstChild
    note.firstTriangles := candidate.node.firstTriangles
    note
  }
}
