package colonnade.formats

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.numbers.{Fixed, FixedPointFormat}

/** What a child of a node is. */
object ChildKind {
  val bits = 2

  def empty: UInt = 0.U(bits.W)

  def node: UInt = 1.U(bits.W)

  def leaf: UInt = 2.U(bits.W)

  def illegal: UInt = 3.U(bits.W)
}

/** A node: up to `arity` child boxes relative to the node's corner.
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

  /** See [[ChildKind]]. */
  val kinds = Vec(geometry.arity, UInt(ChildKind.bits.W))
  val low   = Vec(geometry.arity, Vec3(UInt(geometry.boxBits.W)))
  val high  = Vec(geometry.arity, Vec3(UInt(geometry.boxBits.W)))

  /** What every reader relies on: known kinds, boxes within two cubes, and nodes below this one, so that no walk comes
    * back to a node. A child that would lie beyond the addresses is refused by its section otherwise.
    *
    * @param at the node's own address
    */
  def isLegal(at: UInt): Bool = {
    val isKnown  = !kinds.map(_ === ChildKind.illegal).reduce(_ || _)
    val isSmall  = exponent.axes.map(_ <= config.numbers.mostExponent.U).reduce(_ && _)
    val isBelow  = firstChild > at && !firstChild.head(address - log2Ceil(geometry.arity)).andR
    val hasNodes = kinds.map(_ === ChildKind.node).reduce(_ || _)
    isKnown && isSmall && (isBelow || !hasNodes)
  }
}

/** The triangles of a leaf; the k-th has the packed id `firstTriangle + k`. */
final class TrianglesRecord(config: ColonnadeConfig) extends Bundle {
  private val geometry = config.geometry

  /** Packed id of triangle 0. */
  val firstTriangle = UInt(RecordFormats.idBits(config).W)

  /** From 1 to `trianglesPerRecord`. */
  val count = UInt(NumberFormats.bitLength(geometry.trianglesPerRecord).W)

  /** Of each triangle: it lets some light through, see `shading.clearness`. */
  val isClear = Vec(geometry.trianglesPerRecord, Bool())

  /** Three for each triangle, in vertex units. */
  val vertices = Vec(3 * geometry.trianglesPerRecord, Vec3(UInt(geometry.vertexBits.W)))

  /** It has triangles, and no more than there is space for. */
  def isLegal: Bool = count =/= 0.U && count <= geometry.trianglesPerRecord.U
}

/** What shading needs of one face. Normals have unit length. */
final class Face extends Bundle {
  private val component = new Fixed(FixedPointFormat.signed(NumberFormats.normalBits, NumberFormats.normalFraction))

  /** One for each vertex. */
  val normals         = Vec(3, Vec3(component))
  val geometricNormal = Vec3(component)

  /** Index into the material table. */
  val material = UInt(RecordFormats.materialBits.W)
}

/** Faces in the order of packed ids: face t lies in record `attributeBase + t / facesPerRecord`, slot
  * `t % facesPerRecord`.
  */
final class AttributesRecord extends Bundle {
  val faces = Vec(RecordFormats.facesPerRecord, new Face)
}

/** The records of the column BVH memory: one width for all kinds; a kind takes the low bits it needs. */
final class RecordFormats(config: ColonnadeConfig) {

  /** Bits of a record's address. */
  val addressBits: Int = RecordFormats.addressBits(config)

  /** Bits of a number of records, and of a packed triangle id. */
  val idBits: Int = RecordFormats.idBits(config)

  def node: NodeRecord = new NodeRecord(config)

  def triangles: TrianglesRecord = new TrianglesRecord(config)

  def attributes: AttributesRecord = new AttributesRecord

  /** The widest kind, rounded up to whole 32-bit words. */
  val recordBits: Int = (Seq(node, triangles, attributes).map(_.getWidth).max + 31) / 32 * 32

  /** A record as the memory holds it. */
  def record: UInt = UInt(recordBits.W)

  def asNode(record: UInt): NodeRecord = as(record, node)

  def asTriangles(record: UInt): TrianglesRecord = as(record, triangles)

  def asAttributes(record: UInt): AttributesRecord = as(record, attributes)

  private def as[T <: Data](record: UInt, kind: T): T = record(kind.getWidth - 1, 0).asTypeOf(kind)
}

object RecordFormats {

  /** Bits of a material's index. */
  val materialBits: Int = 8

  /** Faces of one attributes record: a power of two, so that a packed id splits into record and slot. */
  val facesPerRecord: Int = 2
  val faceSlotBits:   Int = log2Ceil(facesPerRecord)

  def addressBits(config: ColonnadeConfig): Int = log2Ceil(config.columnBvhMemory.depth)

  def idBits(config: ColonnadeConfig): Int = addressBits(config) + 1

  /** A box coordinate shifted by the largest exponent still reaches across the cube. */
  def exponentBits(config: ColonnadeConfig): Int = NumberFormats.bitLength(config.numbers.mostExponent)
}
