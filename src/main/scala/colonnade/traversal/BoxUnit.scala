package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Mux1H, Queue, RegEnable, ShiftRegister}
import colonnade.common.{Context, ReservedQueue}
import colonnade.config.TraversalConfig
import colonnade.formats.{NodeRecord, RecordFormats, SceneMap}
import colonnade.numbers.Fixed
import colonnade.ray.{BoxRay, RayFormats}

final class BoxUnitIO(config: TraversalConfig) extends Bundle {
  val in        = Flipped(Decoupled(new BoxCandidate(config)))
  val readyNext = Output(Bool()) // `in` will be ready in the next cycle
  val out       = Decoupled(new BoxResult(config))
  val scene     = Input(new SceneMap(config.device))
  val busy      = Output(Bool()) // the datapath accepts children in this cycle
}

/** Tests one ray against the children of one node (docs/numbers.md, section 3). The result lists the children that the
  * ray enters, sorted by entry distance.
  *
  * Throughput: `units.boxLanes` children per cycle, in order; a node takes arity / `boxLanes` beats. Latency: 5 cycles
  * plus the beats of the node. The pipeline never stalls: a node enters only if the result queue has space for it, and
  * the queue is deep enough for full throughput.
  *
  * The unit relies on guarantees of the packer and of ray set-up. A child's planes are within two cubes of its node's
  * corner. A ray's origin is within half a cube of the object's cube. A reciprocal has at most the digits that set-up
  * computes.
  */
class BoxUnit(config: TraversalConfig) extends Module {
  private val arity = NodeRecord.most
  private val lanes = config.device.units.boxLanes
  private val beats = arity / lanes

  private val latency = BoxDatapath.latency(config)

  /** Nodes in flight at full throughput, from the input to the output of the queue. */
  private val queueDepth = (latency + 2 + beats + beats - 1) / beats

  val io = IO(new BoxUnitIO(config))

  private val tags   = Module(new ReservedQueue(new NodeTag(config), queueDepth)).io
  private val sorted = Module(new Queue(new ChildOrder(config), queueDepth))

  // Accept a node; its first children start at once, the others follow in consecutive beats
  private val beat         = RegInit(0.U(log2Ceil(beats.max(2)).W))
  private val follows      = beat =/= 0.U
  private val nextBeat     = Mux(io.in.fire || follows, Mux(beat === (beats - 1).U, 0.U, beat + 1.U), beat)
  private val inFlight     = RegInit(0.U(log2Ceil(queueDepth + 1).W))
  private val nextInFlight = inFlight + io.in.fire - io.out.fire
  beat        := nextBeat
  inFlight    := nextInFlight
  io.in.ready := inFlight =/= queueDepth.U && !follows
  // With extra slices a result that leaves makes room a cycle later
  private val mayEnter =
    if (config.device.units.extraSlices) inFlight +& io.in.fire < queueDepth.U else nextInFlight =/= queueDepth.U
  io.readyNext  := nextBeat === 0.U && mayEnter
  tags.in.valid := io.in.fire
  tags.in.bits  := NodeTag(config, io.in.bits)
  private val starts   = io.in.fire || follows
  private val endsNode = starts && beat === (beats - 1).U

  // Operands
  private val stored        = Seq.tabulate(arity)(BoxOperands.child(config, io.in.bits.node, _))
  private val orientation   = io.in.bits.ray.orientation
  private val laterChildren = stored.map(RegEnable(_, io.in.fire))
  private val axis          = Mux(follows, RegEnable(orientation.axis, io.in.fire), orientation.axis)
  private val node          = RegEnable(BoxOperands.node(config, io.in.bits), io.in.fire)
  private val datapath      = Module(new BoxDatapath(config, lanes))
  datapath.io.node    := node
  datapath.io.isValid := RegNext(starts, false.B)
  for (lane <- 0 until lanes) {
    val byBeat   = (stored.take(lanes) ++ laterChildren.drop(lanes)).grouped(lanes).map(_(lane)).toSeq
    val child    = Mux1H(byBeat.zipWithIndex.map { case (child, index) => (beat === index.U) -> child })
    val negative = Seq.tabulate(3)(a => Mux(follows, node.negative(a), orientation.negative(a)))
    datapath.io.children(lane) := RegEnable(BoxOperands.planes(config, child, axis, negative), starts)
  }

  // Collect the node's children and sort them
  private val ends                                        = ShiftRegister(endsNode, latency + 1, false.B, true.B)
  private val isEntered                                   = datapath.io.intervals.map(_.isEntered)
  private val tNear                                       = datapath.io.intervals.map(_.tNear)
  private def allBeats[T <: Data](values: Seq[T]): Seq[T] =
    (0 until beats).reverse.flatMap(before => values.map(ShiftRegister(_, before)))
  sorted.io.enq.valid := ends
  sorted.io.enq.bits  := ChildOrder(config, allBeats(isEntered), allBeats(tNear), datapath.io.distance)
  assert(!ends || sorted.io.enq.ready, "a node was accepted without queue space for its result")

  io.out.valid        := sorted.io.deq.valid
  sorted.io.deq.ready := io.out.ready
  tags.out.ready      := io.out.fire
  tags.mayTakeNext    := ends || sorted.io.count =/= io.out.fire.asUInt
  io.out.bits         := tags.out.bits.result(sorted.io.deq.bits, io.scene)
  io.busy             := starts
  assert(!io.out.valid || tags.out.valid, "sorted children without their node")
}

/** What the result needs of a node besides the sorted children. */
private[traversal] final class NodeTag(config: TraversalConfig) extends Bundle {
  val context = Context(config)
  val nodes   = UInt(NodeRecord.countBits.W)
  val count   = UInt(NodeRecord.countBits.W)
  val first   = UInt(RecordFormats.addressBits(config.device).W)

  def result(order: ChildOrder, scene: SceneMap): BoxResult = {
    val result = Wire(new BoxResult(config))
    result.context := context
    result.count   := order.count
    result.tests   := count
    for ((child, entered) <- result.children.zip(order.children)) {
      val isLeaf = entered.slot >= nodes
      child.target.isLeaf  := isLeaf
      child.target.address := first + Mux(isLeaf, nodes +& scene.leafRecords(entered.slot - nodes), entered.slot)
      child.tNear          := Fixed(new RayFormats(config.numbers).units, order.distance.units(entered.tNear).zext)
    }
    result
  }
}

private[traversal] object NodeTag {
  def apply(config: TraversalConfig, candidate: BoxCandidate): NodeTag = {
    val tag = Wire(new NodeTag(config))
    tag.context := candidate.context
    tag.nodes   := candidate.node.nodes
    tag.count   := candidate.node.count
    tag.first   := candidate.node.first
    tag
  }
}

/** The record of a node or of a leaf's triangles. */
final class NodeRef(config: TraversalConfig) extends Bundle {
  val isLeaf  = Bool()
  val address = UInt(RecordFormats.addressBits(config.device).W)
}

/** A child whose box a ray enters, and the entry distance in units. */
final class EnteredChild(config: TraversalConfig) extends Bundle {
  val target = new NodeRef(config)
  val tNear  = new Fixed(new RayFormats(config.numbers).units)
}

/** One ray to test against one node; `tMax` is the largest entry distance that may still hold a hit, see [[TMaxUnits]].
  */
final class BoxCandidate(config: TraversalConfig) extends Bundle {
  val context = Context(config)
  val node    = new RecordFormats(config.device).node
  val ray     = new BoxRay(config.numbers)
  val tMax    = new Fixed(new RayFormats(config.numbers).units)
}

/** The children that the ray enters: the first `count` of `children`, sorted by entry distance. */
final class BoxResult(config: TraversalConfig) extends Bundle {
  val context  = Context(config)
  val count    = UInt(log2Ceil(NodeRecord.most + 1).W)
  val children = Vec(NodeRecord.most, new EnteredChild(config))

  /** Children tested, without empty ones. */
  val tests = UInt(log2Ceil(NodeRecord.most + 1).W)
}
