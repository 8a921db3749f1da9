package colonnade.traversal

import chisel3._
import chisel3.util.Cat
import colonnade.config.TraversalConfig
import colonnade.formats.{ChildBox, NodeRecord, RecordFormats}
import colonnade.ray.{PermutedFrame, RayFormats}

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

/** A child's planes, counted along the ray from the first plane of the node's range: the ray crosses `nearPlanes` first. */
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
