package colonnade.formats

import chisel3._
import chisel3.util.{log2Ceil, PriorityEncoder}
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.numbers.{Fixed, FixedPointFormat}

/** A child's planes, relative to its node's corner. */
final class ChildBox(boxBits: Int) extends Bundle {
  val high = Vec3(UInt(boxBits.W))
  val low  = Vec3(UInt(boxBits.W))
}

/** A node: the boxes of up to [[NodeRecord.most]] children. These are at consecutive records from `first`, nodes before
  * leaves; with `scene.hasColours` a leaf takes two records.
  *
  * A child's planes are `origin + (low << exponent)` and `origin + (high << exponent)`, in vertex units.
  */
final class NodeRecord(config: ColonnadeConfig) extends Bundle {
  private val geometry = config.geometry
  private val address  = RecordFormats.addressBits(config)

  /** Numbers of children. */
  val nodes  = UInt(NodeRecord.countBits.W)
  val leaves = UInt(NodeRecord.countBits.W)

  val first = UInt(address.W)

  /** `2 * origin + 2^exponent`: the origin is a multiple of 2^exponent. */
  val corner = Vec3(UInt((geometry.vertexBits + 1).W))

  val children = Vec(NodeRecord.most, new ChildBox(geometry.boxBits))

  def exponent: Vec3[UInt] = Vec3.of(corner.axes.map(value => PriorityEncoder(exponentBits(value))))
  def origin: Vec3[UInt]   = Vec3.of(corner.axes.map(value => (value & (value - 1.U)).head(geometry.vertexBits)))

  /** Number of children. */
  def count: UInt = nodes +& leaves

  /** The guarantees that every reader relies on: boxes within two cubes, and children at higher addresses, so that no
    * traversal returns to a node. The record fetch reports other illegal addresses.
    *
    * @param at the node's own address
    */
  def isLegal(at: UInt): Bool = {
    val isSmall = corner.axes.map(exponentBits(_).orR).reduce(_ && _)
    val isBelow = first > at && !(first +& (count -% 1.U)).head(1).asBool
    count === 0.U || (count <= NodeRecord.most.U && isSmall && isBelow)
  }

  private def exponentBits(corner: UInt): UInt = corner(config.numbers.maxExponent, 0)
}

object NodeRecord {

  /** Most children of a node. */
  val most:      Int = 4
  val countBits: Int = NumberFormats.bitLength(most)
}

/** The attributes of one face for shading. Normals have unit length. */
final class Face(config: ColonnadeConfig) extends Bundle {
  private val component = new Fixed(FixedPointFormat.signed(NumberFormats.normalBits, NumberFormats.normalFraction))

  val normals         = Vec(3, Vec3(component)) // one per vertex
  val geometricNormal = Vec3(component)

  val colours = Option.when(config.geometry.cornerColours)(Vec(3, Rgb(FrameRegisters.colour))) // see [[ColoursRecord]]

  val material = UInt(RecordFormats.materialBits.W) // index into the material table
}

/** The companion of a leaf, in the next record, with `scene.hasColours`: the linear albedo at each of its vertices, for
  * materials with `hasCornerColours`; for those with `hasTexture` red and green are a position in the atlas.
  */
final class ColoursRecord extends Bundle {
  val colours = Vec(Leaf.maxVertices, Rgb(FrameRegisters.colour))
}

/** The records of the column BVH memory. All kinds have one width; a kind uses the low bits that it needs. */
final class RecordFormats(config: ColonnadeConfig) {

  val addressBits: Int = RecordFormats.addressBits(config)

  /** Width of a number of records, and of a packed triangle id. */
  val idBits: Int = RecordFormats.idBits(config)

  def node: NodeRecord = new NodeRecord(config)

  /** All kinds of records by name: nodes, the formats of leaves, and their companions. */
  val kinds: Seq[(String, Data)] =
    ("node" -> node) +: LeafRecord.kinds(config.geometry) ++: Option.when(config.geometry.cornerColours)(
      "colours" -> new ColoursRecord
    ).toSeq

  /** The widest kind, rounded up to whole 32-bit words. */
  val recordBits: Int = (kinds.map(_._2.getWidth).max + 31) / 32 * 32

  def record: UInt = UInt(recordBits.W)

  def asNode(record:    UInt): NodeRecord    = as(record, node)
  def asColours(record: UInt): ColoursRecord = as(record, new ColoursRecord)

  private def as[T <: Data](record: UInt, kind: T): T = record(kind.getWidth - 1, 0).asTypeOf(kind)
}

object RecordFormats {

  val materialBits: Int = 8

  def addressBits(config: ColonnadeConfig): Int = log2Ceil(config.columnBvhMemory.depth)
  def idBits(config:      ColonnadeConfig): Int = addressBits(config) + 1

  /** The largest exponent lets a box coordinate reach across the cube. */
  def exponentBits(config: ColonnadeConfig): Int = NumberFormats.bitLength(config.numbers.maxExponent)
}
