package colonnade.formats

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.numbers.{Fixed, FixedPointFormat}

/** The kind of a child of a node. */
object ChildKind {
  val bits = 2

  def empty: UInt   = 0.U(bits.W)
  def node: UInt    = 1.U(bits.W)
  def leaf: UInt    = 2.U(bits.W)
  def illegal: UInt = 3.U(bits.W)
}

/** A node: up to [[NodeRecord.children]] child boxes relative to the node's corner, which is a multiple of 2^exponent on each axis.
  *
  * A child's planes are `origin + (low << exponent)` and `origin + (high << exponent)`, in vertex units. Children of
  * kind node lie at consecutive records from `firstChild`, in slot order; children of kind leaf are one triangles
  * record each, consecutive from `firstTriangles`, in slot order. The root is record 0.
  */
final class NodeRecord(config: ColonnadeConfig) extends Bundle {
  private val geometry = config.geometry
  private val address  = RecordFormats.addressBits(config)

  val origin         = Vec3(UInt(geometry.vertexBits.W))
  val exponent       = Vec3(UInt(RecordFormats.exponentBits(config).W))
  val firstChild     = UInt(address.W)
  val firstTriangles = UInt(address.W)
  val kinds          = Vec(NodeRecord.children, UInt(ChildKind.bits.W)) // see [[ChildKind]]
  val low            = Vec(NodeRecord.children, Vec3(UInt(geometry.boxBits.W)))
  val high           = Vec(NodeRecord.children, Vec3(UInt(geometry.boxBits.W)))

  /** The guarantees that every reader relies on: known kinds, boxes within two cubes, and child nodes at higher addresses,
    * so that no traversal returns to a node. The record fetch reports other illegal child addresses.
    *
    * @param at the node's own address
    */
  def isLegal(at: UInt): Bool = {
    val isKnown  = !kinds.map(_ === ChildKind.illegal).reduce(_ || _)
    val isSmall  = exponent.axes.map(_ <= config.numbers.maxExponent.U).reduce(_ && _)
    val isBelow  = firstChild > at && !firstChild.head(address - log2Ceil(NodeRecord.children)).andR
    val hasNodes = kinds.map(_ === ChildKind.node).reduce(_ || _)
    isKnown && isSmall && (isBelow || !hasNodes)
  }
}

object NodeRecord {
  val children: Int = 4
}

/** The triangles of a leaf, a pair with a common edge or one triangle; the k-th has the packed id `2 * address + k`. */
final class TrianglesRecord(config: ColonnadeConfig) extends Bundle {
  private val geometry = config.geometry

  /** 1 or 2. */
  val count = UInt(NumberFormats.bitLength(TrianglesRecord.most).W)

  /** By triangle: its material transmits light, see `shading.shadowTransmittance`. */
  val isClear = Vec(TrianglesRecord.most, Bool())

  /** Three per triangle, in vertex units. */
  val vertices = Vec(3 * TrianglesRecord.most, Vec3(UInt(geometry.vertexBits.W)))

  def isLegal: Bool = count =/= 0.U && count <= TrianglesRecord.most.U
}

object TrianglesRecord {

  /** Most triangles of a leaf. */
  val most: Int = 2
}

/** The attributes of one face for shading. Normals have unit length. */
final class Face(config: ColonnadeConfig) extends Bundle {
  private val component = new Fixed(FixedPointFormat.signed(NumberFormats.normalBits, NumberFormats.normalFraction))

  val normals         = Vec(3, Vec3(component)) // one per vertex
  val geometricNormal = Vec3(component)

  /** The linear albedo at each vertex, for materials with `hasCornerColours`; for those with `hasTexture` red and
    * green are a position in the atlas.
    */
  val colours = if (config.geometry.cornerColours) Some(Vec(3, Rgb(FrameRegisters.colour))) else None

  val material = UInt(RecordFormats.materialBits.W) // index into the material table
}

/** Faces in the order of leaves, two for each. That of the packed id t is number f = t − 2 · triangleBase: in record
  * `attributeBase + f / facesPerRecord`, slot `f % facesPerRecord`.
  */
final class AttributesRecord(config: ColonnadeConfig) extends Bundle {
  val faces = Vec(RecordFormats.facesPerRecord(config), new Face(config))
}

/** The records of the column BVH memory. All kinds have one width; a kind uses the low bits that it needs. */
final class RecordFormats(config: ColonnadeConfig) {

  val addressBits: Int = RecordFormats.addressBits(config)

  /** Width of a number of records, and of a packed triangle id. */
  val idBits: Int = RecordFormats.idBits(config)

  def node: NodeRecord             = new NodeRecord(config)
  def triangles: TrianglesRecord   = new TrianglesRecord(config)
  def attributes: AttributesRecord = new AttributesRecord(config)

  /** The widest kind, rounded up to whole 32-bit words. */
  val recordBits: Int = (Seq(node, triangles, attributes).map(_.getWidth).max + 31) / 32 * 32

  def record: UInt = UInt(recordBits.W)

  def asNode(record:       UInt): NodeRecord       = as(record, node)
  def asTriangles(record:  UInt): TrianglesRecord  = as(record, triangles)
  def asAttributes(record: UInt): AttributesRecord = as(record, attributes)

  private def as[T <: Data](record: UInt, kind: T): T = record(kind.getWidth - 1, 0).asTypeOf(kind)
}

object RecordFormats {

  val materialBits: Int = 8

  /** Faces per attribute record: a power of two, so that a packed id splits into record and slot. */
  def facesPerRecord(config: ColonnadeConfig): Int = if (config.geometry.cornerColours) 1 else 2
  def faceSlotBits(config:   ColonnadeConfig): Int = log2Ceil(facesPerRecord(config))

  def addressBits(config: ColonnadeConfig): Int = log2Ceil(config.columnBvhMemory.depth)
  def idBits(config:      ColonnadeConfig): Int = addressBits(config) + 1

  /** The largest exponent lets a box coordinate reach across the cube. */
  def exponentBits(config: ColonnadeConfig): Int = NumberFormats.bitLength(config.numbers.maxExponent)
}
