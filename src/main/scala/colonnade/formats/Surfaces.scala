package colonnade.formats

import chisel3._
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.numbers.{Fixed, FixedPointFormat}

import scala.collection.immutable.SeqMap

/** A point light. Its colour is its intensity where the squared distance is `reachMantissa · 2^reachExponent`, in grid
  * steps; it falls with the squared distance. With a mantissa of 0 it is the same everywhere.
  */
final class Light(numbers: NumberFormats) extends Bundle {
  val position      = Vec3(SInt(numbers.macBits.W))
  val colour        = Rgb(FrameRegisters.intensity)
  val reachMantissa = UInt(numbers.mantissaBits.W)
  val reachExponent = SInt((NumberFormats.bitLength(2 * numbers.sceneBits) + 1).W)
}

/** A record, not a bundle: without bounces some fields are not there. */
final class Shading(config: ColonnadeConfig) extends Record {
  private def ifBounces[T](field: => T): Option[T] = if (config.frame.hasBounces) Some(field) else None

  /** Shade with geometric normals, not with the vertices'. */
  val flat = Bool()

  /** Send shadow rays. */
  val shadows = Bool()

  /** Lights that shine: the first so many. */
  val lights = UInt(NumberFormats.bitLength(config.frame.lights).W)

  /** How far a secondary ray starts from the surface, in grid steps along the normal. */
  val offset = UInt((config.numbers.gridBits - 2).W)

  /** Reflections and refractions of a path that are traced; what comes then meets the background only. */
  val bounces = ifBounces(UInt(NumberFormats.bitLength(config.frame.maxBounces).W))

  /** What clear triangles let through of a light. */
  val clearness = ifBounces(FrameRegisters.share)

  val elements: SeqMap[String, Data] = FrameRegisters.fields(
    Seq("flat" -> flat, "shadows" -> shadows, "lights" -> lights, "offset" -> offset) ++
      bounces.map("bounces" -> _) ++ clearness.map("clearness" -> _): _*
  )
}

/** What becomes of a ray that meets a surface. */
object MaterialKind {
  val bits = 2

  /** Lambert's: it takes light from the lights. */
  def diffuse: UInt = 0.U(bits.W)

  def mirror: UInt = 1.U(bits.W)

  /** Refracts, and reflects Schlick's part. */
  def glass: UInt = most.U(bits.W)

  /** The greatest kind. */
  val most: BigInt = 2
}

/** A record, not a bundle: without bounces all that there is of a material is its albedo. */
final class Material(config: ColonnadeConfig) extends Record {
  private def ifBounces[T](field: => T): Option[T] = if (config.frame.hasBounces) Some(field) else None
  private def eta = new Fixed(FixedPointFormat.unsigned(NumberFormats.etaBits, NumberFormats.etaFraction))

  val albedo = Rgb(FrameRegisters.colour)

  /** See [[MaterialKind]]. */
  val kind = ifBounces(UInt(MaterialKind.bits.W))

  /** Glass: the index of the side that the ray comes from over the other one's, for a ray that meets the front or the
    * back of a triangle.
    */
  val etaFront = ifBounces(eta)
  val etaBack  = ifBounces(eta)

  /** Glass: what it reflects head-on. */
  val reflectance = ifBounces(FrameRegisters.share)

  val elements: SeqMap[String, Data] = FrameRegisters.fields(
    Seq("albedo" -> albedo) ++ kind.map("kind" -> _) ++ etaFront.map("etaFront" -> _) ++ etaBack.map("etaBack" -> _) ++
      reflectance.map("reflectance" -> _): _*
  )
}
