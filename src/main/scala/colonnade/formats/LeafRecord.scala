package colonnade.formats

import chisel3._
import chisel3.util.MuxLookup
import colonnade.config.GeometryConfig

/** The format of a leaf: how its body holds vertices and normals. */
object LeafFormat {
  val bits = 2

  def nearPair: UInt = 0.U(bits.W)
  def triangle: UInt = 1.U(bits.W)
  def flatPair: UInt = 2.U(bits.W)
  def farPair: UInt  = 3.U(bits.W)
}

/** A leaf: two triangles (0, 1, 2) and (1, 0, 3) of its vertices, or the first of them. Any bits are legal.
  *
  * @param kind the body, by format; its bits begin at bit 0 of the record
  */
final class LeafRecord[T <: Data](kind: T, bodyBits: Int) extends Bundle {
  val format = UInt(LeafFormat.bits.W) // see [[LeafFormat]]

  /** Its material transmits light, see `shading.shadowTransmittance`. */
  val isClear  = Bool()
  val material = UInt(RecordFormats.materialBits.W) // index into the material table
  val unused   = Option.when(kind.getWidth < bodyBits)(UInt((bodyBits - kind.getWidth).W))
  val body     = kind.cloneType
}

/** Four absolute vertices, in vertex units; geometric normals stand for corner normals. */
final class FlatPair(geometry: GeometryConfig) extends Bundle {
  val vertices = Vec(Leaf.maxVertices, Vec3(UInt(geometry.vertexBits.W)))
}

/** Three absolute vertices, in vertex units, and their normals. */
final class SingleTriangle(geometry: GeometryConfig) extends Bundle {
  val normals  = Vec(3, Octahedral.code)
  val vertices = Vec(3, Vec3(UInt(geometry.vertexBits.W)))
}

/** Four normals and vertices, which are vertex 0 plus a delta and wrap at their width. */
final class NearPair(geometry: GeometryConfig) extends Bundle {
  val lowBits = Vec(Leaf.maxVertices, new Octahedral(Bool()))
  val normals = Vec(Leaf.maxVertices, Octahedral.high) // without their lowest bits
  val deltas  = Vec(3, Vec3(SInt(LeafRecord.deltaBits(geometry).W)))
  val vertex  = Vec3(UInt(geometry.vertexBits.W))
}

/** A [[NearPair]] of longer deltas, whose normals have no lowest bits. */
final class FarPair(geometry: GeometryConfig) extends Bundle {
  val signs   = Vec(3, Vec3(Bool())) // the top bits of the deltas
  val normals = Vec(Leaf.maxVertices, Octahedral.high)
  val deltas  = Vec(3, Vec3(UInt(LeafRecord.deltaBits(geometry).W)))
  val vertex  = Vec3(UInt(geometry.vertexBits.W))
}

/** A direction as a point (u, v) of the unfolded octahedron |x| + |y| + |z| = 1023; the lowest number counts as the one
  * above it. The lower half, z < 0, is folded outwards: (u, v) there is (1023 - |y|, 1023 - |x|), with the signs of x
  * and y.
  */
final class Octahedral[T <: Data](component: T) extends Bundle {
  val u = component.cloneType
  val v = component.cloneType
}

object Octahedral {

  /** Of each component of a code. */
  val bits: Int = 11

  def code: Octahedral[SInt] = new Octahedral(SInt(bits.W))

  /** A code without its lowest bits. */
  def high: Octahedral[SInt] = new Octahedral(SInt((bits - 1).W))
}

object LeafRecord {

  private val headBits = LeafFormat.bits + 1 + RecordFormats.materialBits

  /** The least number of whole words, at least 256 bits: so up to 19 bits of a vertex's coordinate. */
  def recordBits(geometry: GeometryConfig): Int = {
    val bodies = Seq(new FlatPair(geometry), new SingleTriangle(geometry))
    ((bodies.map(_.getWidth + headBits) :+ 256).max + 31) / 32 * 32
  }

  /** Without format, transmittance and material. */
  def bodyBits(geometry: GeometryConfig): Int = recordBits(geometry) - headBits

  /** Of a near pair's delta: what the other fields of a far pair leave. */
  def deltaBits(geometry: GeometryConfig): Int =
    (bodyBits(geometry) - 8 * (Octahedral.bits - 1) - 9 - 3 * geometry.vertexBits) / 9

  /** All formats by name. */
  def kinds(geometry: GeometryConfig): Seq[(String, Data)] = Seq(
    "nearPair" -> nearPair(geometry),
    "triangle" -> triangle(geometry),
    "flatPair" -> flatPair(geometry),
    "farPair"  -> farPair(geometry)
  )

  def flatPair(geometry: GeometryConfig): LeafRecord[FlatPair]       = as(geometry, new FlatPair(geometry))
  def triangle(geometry: GeometryConfig): LeafRecord[SingleTriangle] = as(geometry, new SingleTriangle(geometry))
  def nearPair(geometry: GeometryConfig): LeafRecord[NearPair]       = as(geometry, new NearPair(geometry))
  def farPair(geometry:  GeometryConfig): LeafRecord[FarPair]        = as(geometry, new FarPair(geometry))

  private def as[T <: Data](geometry: GeometryConfig, body: T) = new LeafRecord(body, bodyBits(geometry))
}

/** What a leaf holds, whatever its format. */
final class Leaf(geometry: GeometryConfig, record: UInt) {
  private val flat     = as(LeafRecord.flatPair(geometry))
  private val triangle = as(LeafRecord.triangle(geometry))
  private val near     = as(LeafRecord.nearPair(geometry))
  private val far      = as(LeafRecord.farPair(geometry))

  private val isFar      = near.format === LeafFormat.farPair
  private val isRelative = isFar || near.format === LeafFormat.nearPair

  def isClear: Bool  = near.isClear
  def material: UInt = near.material

  /** Whether it is a pair. */
  def isPair: Bool = near.format =/= LeafFormat.triangle

  /** Whether geometric normals stand for its corner normals. */
  def isFlat: Bool = near.format === LeafFormat.flatPair

  /** A vertex, in vertex units, by three adders; the last one is for a pair. */
  def vertex(index: UInt): Vec3[UInt] = {
    val sums = for (axis <- 0 until 3) yield {
      val deltas = near.body.deltas.map(_.axes(axis)).zip(far.body.signs.map(_.axes(axis))).map { case (delta, sign) =>
        (Mux(isFar, sign, delta.head(1).asBool) ## delta.asUInt).asSInt
      }
      val to     = at(index, 0.S +: deltas)
      val origin = flat.body.vertices.head.axes(axis)
      val moved  = (origin.asSInt.pad(geometry.vertexBits.max(to.getWidth)) +% to)
        .asUInt(geometry.vertexBits - 1, 0)
      Mux(isRelative, moved, at(index, flat.body.vertices.map(_.axes(axis))))
    }
    Vec3.of(sums)
  }

  /** The code of the normal at a vertex of a leaf that is not flat. */
  def normal(index: UInt): Octahedral[SInt] = {
    val pairs = near.body.normals.zip(near.body.lowBits).map { case (high, low) =>
      val code = Wire(Octahedral.code)
      code.u := (high.u.asUInt ## (low.u && !isFar)).asSInt
      code.v := (high.v.asUInt ## (low.v && !isFar)).asSInt
      code
    }
    Mux(isRelative, at(index, pairs), at(index, triangle.body.normals))
  }

  private def at[T <: Data](index: UInt, choices: Seq[T]): T =
    MuxLookup(index, choices.head)(choices.zipWithIndex.tail.map { case (choice, i) => i.U -> choice })

  private def as[T <: Data](kind: T): T = record(kind.getWidth - 1, 0).asTypeOf(kind)
}

object Leaf {

  /** Vertices and triangles of a pair. */
  val maxVertices:  Int = 4
  val maxTriangles: Int = 2

  /** The vertices of the second triangle, and of the first one, by corner. */
  val corners: Seq[(Int, Int)] = Seq(1 -> 0, 0 -> 1, 3 -> 2)
}
