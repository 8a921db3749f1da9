package colonnade.traversal

import chisel3._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{ChildKind, NodeRecord, RecordFormats, Vec3}
import colonnade.ray.{PermutedFrame, RayFormats}

/** What the box test of all children of a node shares: numbers of the ray's own frame. */
final class NodeOperands(config: ColonnadeConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new RayFormats(numbers)

  val negative = Vec(3, Bool())

  /** The node's corner as seen from the ray's origin, in units. Ray set-up keeps the origin within half a cube of the
    * object's cube, so that the difference takes no more bits.
    */
  val corner = Vec(3, SInt((numbers.vertexBits + 2).W))

  /** Units of a child's planes, as a shift. */
  val exponent = Vec(3, UInt(RecordFormats.exponentBits(config).W))

  /** The reciprocals' computed digits; the low bits that set-up leaves clear are not carried along. */
  val reciprocal = Vec(2, UInt((numbers.reciprocalDigits + 1).W))

  /** Bits to drop from a product with a whole reciprocal. */
  val drop = Vec(2, UInt(formats.exponentBits.W))

  /** Largest near that counts, in units. */
  val limit = SInt(numbers.boxDistanceBits.W)
}

/** A child's planes relative to the node's corner, in the ray's own frame: `near` are those met first. */
final class ChildPlanes(config: ColonnadeConfig) extends Bundle {
  val isOccupied = Bool()
  val near       = Vec(3, UInt(config.geometry.boxBits.W))
  val far        = Vec(3, UInt(config.geometry.boxBits.W))
}

/** A child as its record has it, in the object's frame. */
final class StoredChild(config: ColonnadeConfig) extends Bundle {
  private val plane = UInt(config.geometry.boxBits.W)

  val kind = UInt(ChildKind.bits.W)
  val low  = Vec3(plane)
  val high = Vec3(plane)
}

/** Turns a record and a ray into operands: selections, and one subtraction an axis. */
object BoxOperands {

  def node(config: ColonnadeConfig, candidate: BoxCandidate): NodeOperands = {
    val numbers  = config.numbers
    val ray      = candidate.ray
    val operands = Wire(new NodeOperands(config))
    operands.negative := ray.heading.negative
    operands.exponent := VecInit(PermutedFrame(candidate.node.exponent, ray.heading.axis))
    operands.limit    := candidate.limit.integer

    val origin = PermutedFrame(candidate.node.origin, ray.heading.axis)
    for (axis <- 0 until 3) {
      val difference = origin(axis).zext -& ray.origin(axis).integer
      operands.corner(axis) := difference.asUInt(numbers.vertexBits + 1, 0).asSInt
    }
    for (axis <- 0 until 2) {
      operands.reciprocal(
        axis
      )                   := ray.reciprocal(axis).natural >> (numbers.reciprocalFraction - numbers.reciprocalDigits)
      operands.drop(axis) := numbers.reciprocalFraction.U - ray.exponent(axis)
    }
    operands
  }

  def child(config: ColonnadeConfig, node: NodeRecord, slot: Int): StoredChild = {
    val stored = Wire(new StoredChild(config))
    stored.kind := node.kinds(slot)
    stored.low  := node.low(slot)
    stored.high := node.high(slot)
    stored
  }

  /** The planes in the frame of a ray with that dominant axis and those signs. */
  def planes(config: ColonnadeConfig, child: StoredChild, axis: UInt, negative: Seq[Bool]): ChildPlanes = {
    val result = Wire(new ChildPlanes(config))
    val low    = PermutedFrame(child.low, axis)
    val high   = PermutedFrame(child.high, axis)
    result.isOccupied := BoxOperands.isOccupied(child.kind)
    for (a <- 0 until 3) {
      result.near(a) := Mux(negative(a), high(a), low(a))
      result.far(a)  := Mux(negative(a), low(a), high(a))
    }
    result
  }

  /** Whether there is a child to test: a node or a leaf. */
  def isOccupied(kind: UInt): Bool = kind === ChildKind.node || kind === ChildKind.leaf
}
