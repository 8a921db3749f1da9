package colonnade.traversal

import chisel3._
import chisel3.util.{Cat, RegEnable}
import colonnade.common.TimingSlice
import colonnade.config.TraversalConfig
import colonnade.formats.{ChildBox, NodeRecord, RecordFormats}
import colonnade.numbers.Rounding
import colonnade.ray.{PermutedFrame, RayFormats}

/** The interval of t in which a ray is inside a child's box, relative to its node; empty if `tNear` exceeds `tFar`. */
final class BoxInterval(config: TraversalConfig) extends Bundle {
  val isOccupied = Bool()
  val tNear      = SInt(config.numbers.nearBits.W)
  val tFar       = SInt(config.numbers.nearBits.W)

  def isEntered: Bool = isOccupied && tNear <= tFar
}

/** Converts t of a node's children to units: t · 2^(`exponent` - `nearFraction`) - `toOrigin`, at least 0. */
final class NodeDistance(config: TraversalConfig) extends Bundle {
  private val numbers = config.numbers

  val toOrigin = SInt(numbers.boxDistanceBits.W)
  val exponent = UInt(RecordFormats.exponentBits(config.device).W)

  /** Combinational; rounds down. `t` is at most the node's last z' plane's. */
  def units(t: SInt): UInt = {
    val distance = ((t << exponent).asSInt >> numbers.nearFraction) - toOrigin
    Mux(distance < 0.S, 0.U, distance.asUInt(numbers.boxDistanceBits - 2, 0))
  }
}

final class BoxDatapathIO(config: TraversalConfig, lanes: Int) extends Bundle {
  val node      = Input(new NodeOperands(config))
  val isValid   = Input(Bool())                    // new children are at the input
  val children  = Input(Vec(lanes, new ChildPlanes(config)))
  val intervals = Output(Vec(lanes, new BoxInterval(config)))
  val distance  = Output(new NodeDistance(config)) // with `intervals`
}

/** Slab test of one ray against `lanes` boxes in padded integers (docs/numbers.md, section 3), without control logic.
  *
  * Latency `BoxDatapath.latency` cycles, throughput one set of boxes per cycle, no stalls. [[NodeStage]] multiplies
  * the corner of the node; each lane has four short multipliers, because the dominant axis needs none. A box beyond
  * `tMax` has an empty interval. The registers of a lane hold while it has no child to test.
  */
class BoxDatapath(config: TraversalConfig, lanes: Int) extends Module {
  private val numbers = config.numbers
  require(
    numbers.boxPadLog <= numbers.vertexBits - 2,
    s"boxes are widened by 2^${numbers.boxPadLog} units; a quarter of the cube, 2^${numbers.vertexBits - 2}, is the most"
  )

  val io = IO(new BoxDatapathIO(config, lanes))

  // By stage: the children are valid; and the child of a lane is one to test
  private val isValid  = stages(io.isValid)
  private val isTested = io.children.map(child => stages(io.isValid && child.isOccupied))

  private val nodeStage      = Module(new NodeStage(config))
  private val (steps, terms) = (nodeStage.io.steps, nodeStage.io.terms)
  nodeStage.io.node    := io.node
  nodeStage.io.isValid := VecInit(isValid.take(2))

  // While the node stage multiplies its corner, the planes wait
  private val children = byLane(io.children, stage = 0)(RegEnable(_, _))

  // Multiply the planes by the steps; along z' a plane is t already
  private def products(planes: ChildPlanes => Vec[UInt], steps: Vec[UInt]) = byLane(children, stage = 1) {
    (child, isTested) => Seq.tabulate(2)(axis => RegEnable(planes(child)(axis) * steps(axis), isTested))
  }
  private val nearProducts = products(_.nearPlanes, steps.down)
  private val farProducts  = products(_.farPlanes, steps.up)

  private def z(plane: UInt): SInt = (plane << numbers.nearFraction).zext
  private val nearZ                = byLane(children, stage = 1)((child, isTested) =>
    RegEnable(Rounding.narrow(z(child.nearPlanes(2)) -& steps.pad.zext, numbers.nearBits), isTested)
  )
  private val farZ = byLane(children, stage = 1)((child, isTested) =>
    RegEnable(Rounding.narrow(z(child.farPlanes(2)) +& steps.pad.zext, numbers.nearBits), isTested)
  )

  // Add the node's terms, and shift to the node's t
  private val slice        = TimingSlice.extra(config.device)
  private val intersection = BoxDatapath.latency(config) - 1
  private val shiftRight   = terms.shiftRight.map(slice(_, isValid(2)))
  private val shifts       = shiftRight.map(
    new SaturatingShift(_, numbers.nearBits - 1 + numbers.stepReach - numbers.nearFraction, numbers.nearBits)
  )
  private def sides(products: Seq[Seq[UInt]], nodes: Vec[SInt]) = {
    val sums = byLane(products, stage = 2) { (lane, isTested) =>
      Seq.tabulate(2) { axis =>
        slice(Rounding.narrow(nodes(axis) +& lane(axis).zext, numbers.nodeBits + 1), isTested)
      }
    }
    byLane(sums, stage = intersection - 1) { (lane, isTested) =>
      Seq.tabulate(2)(axis => RegEnable(shifts(axis)((lane(axis) << (numbers.nearBits - 1)).asSInt), isTested))
    }
  }
  private val sideTNears = sides(nearProducts, terms.near)
  private val sideTFars  = sides(farProducts, terms.far)
  private val zTNears    =
    held(byLane(nearZ, stage = 2)((z, isTested) => RegEnable(greatest(z, terms.origin), isTested)))
  private val zTFars = held(byLane(farZ, stage = 2)((z, isTested) => RegEnable(least(z, terms.tMax), isTested)))

  // Intersect the intervals of the three slabs
  for (lane <- 0 until lanes) {
    val interval = Wire(new BoxInterval(config))
    interval.isOccupied := isTested(lane)(intersection)
    interval.tNear      := greatest(greatest(sideTNears(lane)(0), sideTNears(lane)(1)), zTNears(lane))
    interval.tFar       := least(least(sideTFars(lane)(0), sideTFars(lane)(1)), zTFars(lane))
    io.intervals(lane)  := RegEnable(interval, isValid(intersection))
  }

  // The node's own distance goes with its children
  private val exponent = isValid.take(2).foldLeft(io.node.exponent(2))(RegEnable(_, _))
  private val distance = Wire(new NodeDistance(config))
  distance.toOrigin := nodeStage.io.toOrigin
  distance.exponent := exponent
  io.distance       := isValid.drop(2).foldLeft(distance)(RegEnable(_, _))

  /** A flag in each stage: at the input, and after each register of the datapath but the last. */
  private def stages(flag: Bool): IndexedSeq[Bool] =
    Iterator.iterate(flag)(RegNext(_, false.B)).take(BoxDatapath.latency(config)).toIndexedSeq

  /** The operands of each lane, with the enable of its registers in a stage. */
  private def byLane[T, R](operands: Seq[T], stage: Int)(register: (T, Bool) => R): Seq[R] =
    operands.zip(isTested).map { case (lane, flags) => register(lane, flags(stage)) }

  /** The third slab waits while the others are shifted. */
  private def held(z: Seq[SInt]): Seq[SInt] = if (slice.isEnabled) byLane(z, stage = 3)(slice(_, _)) else z

  private def least(a:    SInt, b: SInt): SInt = Mux(a < b, a, b)
  private def greatest(a: SInt, b: SInt): SInt = Mux(a < b, b, a)
}

object BoxDatapath {

  /** Cycles from operands to intervals. An extra slice registers the sums before they are shifted. */
  def latency(config: TraversalConfig): Int = 4 + TimingSlice.extra(config.device).cycles
}

/** Operands that the box tests of all children of a node share, in the ray's own frame. */
final class NodeOperands(config: TraversalConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new RayFormats(numbers)

  val negative = Vec(3, Bool())

  /** The node's corner relative to the ray's origin, in units. Ray set-up keeps the origin within half a cube of the
    * object's cube, which bounds the width of the difference.
    */
  val corner = Vec(3, SInt((numbers.vertexBits + 2).W))

  /** Log2 of the unit of a child's planes. */
  val exponent = Vec(3, UInt(RecordFormats.exponentBits(config.device).W))

  /** The computed digits of the reciprocals, without the low bits, which ray set-up leaves at 0. */
  val reciprocal = Vec(2, UInt((numbers.reciprocalDigits + 1).W))

  /** Right shift of a product with a full-width reciprocal. */
  val shiftRight = Vec(2, UInt(formats.exponentBits.W))

  /** Largest entry distance that may hold a hit, in units. */
  val tMax = SInt(numbers.boxDistanceBits.W)
}

/** A child's planes, counted along the ray from the first plane of the node's range: the ray crosses `nearPlanes`
  * first.
  */
final class ChildPlanes(config: TraversalConfig) extends Bundle {
  val isOccupied = Bool()
  val nearPlanes = Vec(3, UInt(config.device.geometry.boxBits.W))
  val farPlanes  = Vec(3, UInt(config.device.geometry.boxBits.W))
}

/** A child as its record stores it, in the object's frame. */
final class StoredChild(config: TraversalConfig) extends Bundle {
  val isOccupied = Bool()
  val box        = new ChildBox(config.device.geometry.boxBits)
}

/** Converts a record and a ray to operands: selections, and one subtraction per axis. */
object BoxOperands {

  def node(config: TraversalConfig, candidate: BoxCandidate): NodeOperands = {
    val numbers  = config.numbers
    val ray      = candidate.ray
    val operands = Wire(new NodeOperands(config))
    operands.negative := ray.orientation.negative
    operands.exponent := VecInit(PermutedFrame(candidate.node.exponent, ray.orientation.axis))
    operands.tMax     := candidate.tMax.integer

    val origin = PermutedFrame(candidate.node.origin, ray.orientation.axis)
    for (axis <- 0 until 3) {
      val complement = Cat(~ray.origin(axis).integer.asUInt, !ray.roundsUp(axis)).asSInt
      val difference = (Cat(origin(axis), true.B).zext +& complement) >> 1
      operands.corner(axis) := difference.asUInt(numbers.vertexBits + 1, 0).asSInt
    }
    for (axis <- 0 until 2) {
      operands.reciprocal(
        axis
      ) := ray.reciprocal(axis).natural >> (numbers.reciprocalFraction - numbers.reciprocalDigits)
      operands.shiftRight(axis) := numbers.reciprocalFraction.U - ray.exponent(axis)
    }
    operands
  }

  def child(config: TraversalConfig, node: NodeRecord, slot: Int): StoredChild = {
    val stored = Wire(new StoredChild(config))
    stored.isOccupied := slot.U < node.count
    stored.box        := node.children(slot)
    stored
  }

  /** The planes in the frame of a ray with this dominant axis and these signs. */
  def planes(config: TraversalConfig, child: StoredChild, axis: UInt, negative: Seq[Bool]): ChildPlanes = {
    val result = Wire(new ChildPlanes(config))
    val low    = PermutedFrame(child.box.low, axis)
    val high   = PermutedFrame(child.box.high, axis)
    result.isOccupied := child.isOccupied
    for (a <- 0 until 3) {
      result.nearPlanes(a) := Mux(negative(a), ~high(a), low(a))
      result.farPlanes(a)  := Mux(negative(a), ~low(a), high(a))
    }
    result
  }
}
