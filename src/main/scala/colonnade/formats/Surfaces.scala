package colonnade.formats

import chisel3._
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.numbers.{Fixed, FixedPointFormat}

/** A point light. `colour` is its intensity at the squared distance `reachMantissa · 2^reachExponent`, in grid steps;
  * the intensity falls with the squared distance. A mantissa of 0 disables falloff.
  */
final class Light(numbers: NumberFormats) extends Bundle {
  val position      = Vec3(SInt(numbers.macBits.W))
  val colour        = Rgb(FrameRegisters.intensity)
  val reachMantissa = UInt(numbers.mantissaBits.W)
  val reachExponent = SInt((NumberFormats.bitLength(2 * numbers.sceneBits) + 1).W)
}

final class Shading(config: ColonnadeConfig) extends Bundle {
  private def ifBounces[T](field: => T): Option[T] = if (config.frame.hasBounces) Some(field) else None

  /** Shade with geometric normals instead of vertex normals; send shadow rays. */
  val flat    = Bool()
  val shadows = Bool()

  /** Number of lights that are on, from the first one. */
  val lights = UInt(NumberFormats.bitLength(config.frame.lights).W)

  /** Distance of the origin of a secondary ray from the surface, in grid steps along the normal. */
  val offset = UInt((config.numbers.gridBits - 2).W)

  /** Maximum number of traced reflections and refractions of a path; the next one meets the background only. */
  val bounces = ifBounces(UInt(NumberFormats.bitLength(config.frame.maxBounces).W))

  /** Transmittance of transmissive triangles for shadow rays. */
  val shadowTransmittance = ifBounces(FrameRegisters.weight)
}

/** A sample point of a scattered ray: docs/gather.md. */
final class SamplePoint extends Bundle {
  val u = UInt(SamplePoint.bits.W)
  val v = UInt(SamplePoint.bits.W)
}

object SamplePoint {
  val bits: Int = 8
}

/** Light that diffuse surfaces gather. */
final class Gather extends Bundle {

  /** Rays that a path gathers, one after the other; 0: none, and every surface has the ambient light. */
  val bounces = UInt(Gather.countBits.W)

  /** The surfaces of the light cube are at 2^(parallax - 1) edges of the object's cube from its middle; 0: far away. */
  val parallax = UInt(Gather.parallaxBits.W)

  /** The sample point of each of them in this frame, before the pixel's. */
  val points = Vec(Gather.maxBounces, new SamplePoint)
}

object Gather {
  def apply(config: ColonnadeConfig): Option[Gather] = Option.when(config.frame.gather)(new Gather)

  val maxBounces: Int = 4
  val countBits:  Int = NumberFormats.bitLength(maxBounces)

  val parallaxBits: Int = 2
}

/** The interaction of a ray with a surface. */
object MaterialKind {
  val bits = 2

  /** Lambertian reflection of the lights. */
  def diffuse: UInt = 0.U(bits.W)
  def mirror: UInt  = 1.U(bits.W)

  /** Refracts, and reflects by Schlick's approximation. */
  def glass: UInt = 2.U(bits.W)

  /** Where it gathers light, reflects it and the lights with a spread. Otherwise as a diffuse surface. */
  def roughMetal: UInt = 3.U(bits.W)

  /** The largest number of a kind. */
  def last(config: ColonnadeConfig): BigInt = if (Lobe(config).nonEmpty) 3 else 2

  /** Whether the path goes on at once, without a look at the lights. */
  def isSpecular(kind: UInt): Bool = kind === mirror || kind === glass
}

/** The spread of the reflections of rough metal: docs/gather.md. Mirrors and glass have `alpha` alone, 0 if they are
  * smooth.
  */
final class Lobe extends Bundle {
  val alpha = UInt(Lobe.alphaBits.W) // the square of the roughness; of mirrors and glass times four
  val slope = UInt(Lobe.slopeBits.W) // how fast it falls with the distance from its axis
  val peak  = UInt(Lobe.peakBits.W)  // 1 / alpha², a logarithm
}

object Lobe {

  /** Of a device with gathered light. */
  def apply(config: ColonnadeConfig): Option[Lobe] = Gather(config).map(_ => new Lobe)

  val alphaBits:     Int = 8
  val facetFraction: Int = 10 // fraction bits of the width at mirrors and glass
  val slopeFraction: Int = 6
  val slopeBits:     Int = 17
  val octaveLog:     Int = 7  // log2 of the steps of a logarithm in an octave
  val peakBits:      Int = octaveLog + 4
  val wholeBits:     Int = 6  // of a share of a light, without its fraction
  val powerBits:     Int = 8  // fraction bits of a power

  private val steps = 1 << octaveLog

  /** By the bits below the leading one: the logarithm in the middle of their interval. */
  val logarithms: Seq[Int] = Seq.tabulate(steps) { index =>
    math.rint(steps * math.log(1 + (index + 0.5) / steps) / math.log(2)).toInt
  }

  /** By the fraction of a logarithm, from 1 to 2. */
  val powers: Seq[Int] =
    Seq.tabulate(steps)(index => math.rint((1 << powerBits) * math.pow(2, index.toDouble / steps)).toInt)
}

final class Material(config: ColonnadeConfig) extends Bundle {
  private def ifBounces[T](field: => T): Option[T] = if (config.frame.hasBounces) Some(field) else None
  private def eta = new Fixed(FixedPointFormat.unsigned(NumberFormats.etaBits, NumberFormats.etaFraction))

  val albedo = Rgb(FrameRegisters.colour)

  /** The albedo is interpolated from the colours at the corners of the face; `albedo` has no effect. */
  val hasCornerColours = if (config.geometry.cornerColours) Some(Bool()) else None

  /** The albedo is the texture's at a position, interpolated from the red and green channels of the corners. */
  val hasTexture = config.geometry.texture.map(_ => Bool())

  /** What a diffuse surface adds to the light that it reflects; no other surface uses it. */
  val emission = if (config.frame.emission) Some(Rgb(FrameRegisters.colour)) else None

  /** See [[MaterialKind]]. */
  val kind = ifBounces(UInt(MaterialKind.bits.W))

  /** Glass: the refractive index on the incident side divided by that on the other side, for a ray that hits the front
    * or the back of a triangle.
    */
  val etaFront = ifBounces(eta)
  val etaBack  = ifBounces(eta)

  /** Glass: reflectance at normal incidence. */
  val reflectance = ifBounces(FrameRegisters.weight)

  /** Rough metal, mirrors and glass. */
  val lobe = Lobe(config)
}
