package colonnade.ray

import chisel3._
import chisel3.util.Valid
import colonnade.common.Context
import colonnade.config.{NumberFormats, PartConfig, PathConfig}
import colonnade.formats.{Bounds, InstanceNumber, RecordFormats, Vec3}
import colonnade.numbers.{Fixed, FixedPointFormat, Rounding}

/** Number formats of a ray (docs/numbers.md). */
final class RayFormats(numbers: NumberFormats) {

  /** A position or distance near the object; a position anywhere in the scene. */
  val grid:  FixedPointFormat = FixedPointFormat.signed(numbers.gridBits, numbers.gridFraction)
  val scene: FixedPointFormat = FixedPointFormat.signed(numbers.sceneBits, numbers.gridFraction)

  /** Slope against the dominant axis, magnitude at most 1. */
  val shear: FixedPointFormat = FixedPointFormat.signed(numbers.gridBits, numbers.shearFraction)

  /** Mantissa of a slope's reciprocal, between a half and two. */
  val reciprocal: FixedPointFormat =
    FixedPointFormat.unsigned(numbers.reciprocalFraction + 1, numbers.reciprocalFraction)

  /** Signed whole units near the object: box origins and the box test's distances. */
  val units: FixedPointFormat = FixedPointFormat.signed(numbers.boxDistanceBits, 0)

  /** The distance by which an origin is advanced, in whole units. */
  val entry: FixedPointFormat = FixedPointFormat.unsigned(numbers.entryBits, 0)

  /** A barycentric weight for the shader, up to a common factor. */
  val weight: FixedPointFormat = FixedPointFormat.unsigned(numbers.barycentricBits, numbers.barycentricBits)

  val exponentBits: Int = NumberFormats.bitLength(numbers.reciprocalFraction)
}

/** What only rays of applications carry, and what only their hits tell, from ray set-up to the results: units pass on
  * what there is, as the user bits of a bus. None in a design without such rays.
  */
object QueryBits {
  def apply[T <: Data](config: PartConfig)(bits: => T): Option[T] = config.device.queries.map(_ => bits)
}

/** A ray to prepare. `dir` is its direction, of any length. A shadow ray ends at origin + dir, the light. */
final class RayRequest(config: PathConfig) extends Bundle {
  private val numbers = config.numbers

  val context  = Context(config)
  val isShadow = Bool()
  val origin   = Vec3(new Fixed(new RayFormats(numbers).scene))
  val dir      = Vec3(SInt(numbers.directionBits.W))
  val limits   = QueryBits(config)(new RayLimits(numbers))
  val visit    = Option.when(config.device.frame.hasInstances)(Valid(new VisitLimit(config)))

  /** Marks a ray of the world. */
  def leadsThroughWorld(): Unit = visit.foreach(_ := 0.U.asTypeOf(Valid(new VisitLimit(config))))
}

/** Of a ray in the axes of an instance: hits at t < tMax count, grid steps. */
final class VisitLimit(config: PathConfig) extends Bundle {
  val instance = InstanceNumber(config.device).get
  val tMax     = UInt((config.numbers.sceneBits + 1).W)
}

/** What an application's ray does not hit: triangles seen from the front or the back, or not opaque. */
final class HitFilter extends Bundle {
  val cullsFront   = Bool()
  val cullsBack    = Bool()
  val refusesClear = Bool()
}

/** The limits of an application's ray in grid steps: hits at tMin ≤ t < tMax count. */
final class RayLimits(numbers: NumberFormats) extends Bundle {
  val tMin   = UInt((numbers.sceneBits + 1).W)
  val tMax   = UInt((numbers.sceneBits + 1).W)
  val filter = new HitFilter
}

/** What is left of [[RayLimits]] at a ray's entry: a tMin of less than a unit. */
final class EntryLimits(numbers: NumberFormats) extends Bundle {
  val tMin   = UInt(numbers.gridFraction.max(0).W)
  val filter = new HitFilter
}

/** A ray's dominant axis (0, 1, 2) and the signs of its direction in the ray's own frame. There, z' is the dominant
  * axis, and x' and y' are the axes after it in cyclic order.
  */
final class RayOrientation extends Bundle {
  val axis     = UInt(2.W)
  val negative = Vec(3, Bool())
}

/** A ray for the box test, in its own frame. Its origin is rounded to units: the unit below it, or the next one if it
  * `roundsUp`, which is the carry of the subtraction that follows.
  */
final class BoxRay(numbers: NumberFormats) extends Bundle {
  private val formats = new RayFormats(numbers)

  val orientation = new RayOrientation
  val origin      = Vec(3, new Fixed(formats.units))
  val roundsUp    = Vec(3, Bool())
  val reciprocal  = Vec(2, new Fixed(formats.reciprocal))
  val exponent    = Vec(2, UInt(formats.exponentBits.W))
}

/** A ray for the triangle test and the shader, in its own frame. */
final class TriangleRay(numbers: NumberFormats) extends Bundle {
  private val formats = new RayFormats(numbers)

  val orientation = new RayOrientation
  val origin      = Vec(3, new Fixed(formats.grid))
  val shear       = Vec(2, new Fixed(formats.shear))
}

/** The stored data of a ray that is traced, in its own frame. */
final class TracedRay(numbers: NumberFormats) extends Bundle {
  private val formats = new RayFormats(numbers)

  val orientation = new RayOrientation
  val origin      = Vec(3, new Fixed(formats.grid))
  val shear       = Vec(2, new Fixed(formats.shear))
  val reciprocal  = Vec(2, new Fixed(formats.reciprocal))
  val exponent    = Vec(2, UInt(formats.exponentBits.W))

  def forTriangles: TriangleRay = {
    val ray = Wire(new TriangleRay(numbers))
    ray.orientation := orientation
    ray.origin      := origin
    ray.shear       := shear
    ray
  }

  /** The origin is close to the object, so it fits the format of the box test. */
  def forBoxes: BoxRay = {
    val ray = Wire(new BoxRay(numbers))
    ray.orientation := orientation
    ray.reciprocal  := reciprocal
    ray.exponent    := exponent
    for (axis <- 0 until 3) {
      val position = origin(axis).integer
      val whole    = Rounding.floor(position, numbers.gridFraction)
      ray.origin(axis)   := Fixed(formats.units, Rounding.narrow(whole, numbers.boxDistanceBits))
      ray.roundsUp(axis) := Rounding.roundsUp(position, numbers.gridFraction)
    }
    ray
  }
}

/** The result of ray set-up. If the ray does not enter the object's box (`enters`), the other fields are invalid. */
final class PreparedRay(config: PartConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new RayFormats(numbers)

  val context  = Context(config)
  val isShadow = Bool()
  val enters   = Bool()
  val ray      = new TracedRay(numbers)
  val tEntry   = new Fixed(formats.entry)
  val tMax     = new Fixed(formats.grid) // hits with t < `tMax` count; never negative
  val limits   = QueryBits(config)(new EntryLimits(numbers))

  /** The instance in whose axes the ray is; none: the world's axes. */
  val visit = InstanceNumber(config.device).map(Valid(_))

  /** The root of its object's tree; ray set-up does not know it. */
  val root = Option.when(config.device.frame.hasInstances)(UInt(RecordFormats.addressBits(config.device).W))
}

object PreparedRay {

  /** The box that a ray enters: of all objects, in the axes of an instance the object's whole cube. */
  def box(numbers: NumberFormats, bounds: Bounds, visit: Option[Valid[UInt]]): Bounds = visit.fold(bounds) { visit =>
    val cube = Wire(new Bounds(numbers))
    cube.low.axes.foreach(_ := 0.U)
    cube.high.axes.foreach(_ := ((BigInt(1) << numbers.vertexBits) - 1).U)
    Mux(visit.valid, cube, bounds)
  }
}

object PermutedFrame {

  /** Components of an object-space vector in the frame of a ray with this dominant axis. */
  def apply[T <: Data](vector: Vec3[T], axis: UInt): Seq[T] = {
    val Seq(x, y, z) = vector.axes
    Seq(Seq(y, z, x), Seq(z, x, y), Seq(x, y, z)).map { case Seq(first, second, third) =>
      chisel3.util.MuxLookup(axis, third)(Seq(0.U -> first, 1.U -> second))
    }
  }

  /** The inverse of [[apply]]. */
  def back[T <: Data](permuted: Seq[T], axis: UInt): Vec3[T] = {
    val Seq(x, y, z)                = permuted
    def select(a: T, b: T, c: T): T = chisel3.util.MuxLookup(axis, c)(Seq(0.U -> a, 1.U -> b))
    Vec3.of(select(z, y, x), select(x, z, y), select(y, x, z))
  }
}
