package colonnade.shading

import chisel3._
import chisel3.util.log2Ceil
import colonnade.common.Context
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.Vec3

/** Widths inside the shader, from the bounds in docs/numbers.md. */
final class ShaderFormats(numbers: NumberFormats) {
  val shadeBits: Int = numbers.shadeBits

  /** Hit points and shadow rays' origins, signed: a grid position, a distance times a shear factor below two, and an
    * offset of at most a quarter of the grid's range.
    */
  val pointBits: Int = numbers.gridBits + 2

  val toLightBits: Int = numbers.sceneBits + 1 // the vector to the light, signed: a difference of scene positions
  val normalSumBits: Int = numbers.barycentricBits + NumberFormats.normalBits + 2 // of three weighted normals, signed
  val normalBits:     Int = normalSumBits.max(shadeBits + 1) // a shading normal before and after scaling, signed
  val vectorBits:     Int = toLightBits.max(normalBits)      // the widest component of a vector, signed
  val cosineBits:     Int = numbers.cosineFraction + 1       // a cosine, from 0 to 1 inclusive
  val brightnessBits: Int = cosineBits + Falloff.integerBits // a cosine multiplied by a falloff

  /** Multiplier operands, signed. The narrow one holds a scaled component or a light's intensity, the wide one also a
    * distance or a brightness.
    */
  val narrowBits:  Int = shadeBits + 1
  val wideBits:    Int = numbers.gridBits.max(shadeBits + 1).max(brightnessBits + 1)
  val productBits: Int = wideBits + narrowBits

  /** A shear factor is multiplied digit by digit. A digit has `shadeBits` bits, the highest one is signed. */
  val shearDigits: Int = (numbers.gridBits - 2) / shadeBits + 1

  val dotBits:         Int = 2 * shadeBits + 2 // three products of components of at most 2^shadeBits
  val normProductBits: Int = 2 * shadeBits     // the product of both mantissas; one of its two highest bits is set

  /** Log2 of a light's reference distance over its distance, both squared. */
  val falloffExponentBits: Int =
    NumberFormats.bitLength(4 * numbers.sceneBits + 2 * shadeBits + numbers.mantissaBits) + 2
}

object ShaderFormats {

  /** Bits of a shadow ray's origin, signed: on the object or on the environment. */
  def originBits(config: PathConfig): Int = {
    val ofObject = new ShaderFormats(config.numbers).pointBits
    if (config.device.hasEnvironment) config.numbers.sceneBits.max(ofObject) else ofObject
  }
}

/** Operands of [[ShaderMultiplier]]. */
final class MultiplierOperands(formats: ShaderFormats) extends Bundle {
  val wide   = SInt(formats.wideBits.W)
  val narrow = SInt(formats.narrowBits.W)
}

/** The angle between two vectors a and b. Both are scaled so that the largest component has `shadeBits` bits.
  *
  * @note a·a = u · 2^(k - 1 + shadeBits) with a mantissa u of `shadeBits` bits and k from 0 to 3; b·b likewise.
  */
final class Angle(formats: ShaderFormats) extends Bundle {
  val isAcute     = Bool()                          // a·b is positive. Otherwise the other fields are meaningless
  val dot         = UInt(formats.dotBits.W)
  val normProduct = UInt(formats.normProductBits.W) // the product of both mantissas u
  val exponent    = UInt(3.W)                       // the sum of both k
}

/** The share of a light's intensity that arrives at a distance, from 0 to 4. */
object Falloff {
  val integerBits: Int = 3
  val bits:        Int = integerBits + NumberFormats.lightFraction

  def apply(): UInt = UInt(bits.W)

  def one: UInt = (1 << NumberFormats.lightFraction).U(bits.W)

  def max: UInt = (4 << NumberFormats.lightFraction).U(bits.W)
}

/** Operands of a light's falloff.
  *
  * @note falloff = reference · 2^exponent / mantissa, where both mantissas are numbers from a half to one
  */
final class FalloffRequest(numbers: NumberFormats) extends Bundle {
  private val formats = new ShaderFormats(numbers)

  val reference = UInt(numbers.mantissaBits.W) // mantissa of the squared reference distance; 0 without a falloff

  /** Of the squared distance. */
  val mantissa = UInt(formats.shadeBits.W)
  val exponent = SInt(formats.falloffExponentBits.W)
}

/** The geometry of one hit and one light. */
final class ShadingPoint(config: PathConfig) extends Bundle {
  private val formats = new ShaderFormats(config.numbers)

  /** The light's number, and whether it is the hit's last light. */
  val light  = UInt(log2Ceil(config.device.frame.lights.max(2)).W)
  val isLast = Bool()

  /** Between the shading normal and the vector to the light. */
  val angle   = new Angle(formats)
  val falloff = new FalloffRequest(config.numbers)

  val surface = new ShadedSurface(config) // the same for all lights of the hit
}

/** A hit and its ray. */
final class ShadedSurface(config: PathConfig) extends Bundle {
  private val formats = new ShaderFormats(config.numbers)

  val context       = Context(config)
  val material      = MaterialIndex(config)
  val isEnvironment = Bool() // the surface belongs to the environment, not to the object

  /** Origin of shadow rays and reflections: the hit point, moved off the surface; grid steps. */
  val origin = Vec3(SInt(ShaderFormats.originBits(config).W))

  /** The shading normal, turned against the ray; its largest component has `shadeBits` bits. */
  val normal = Vec3(SInt(formats.narrowBits.W))

  val isSmooth = Bool() // `normal` is interpolated from the vertices' normals; otherwise it is geometric
  val faceForwardNormal = Vec3(SInt((NumberFormats.normalBits + 1).W)) // the geometric normal, turned against the ray
  val dir      = Vec3(SInt((formats.shadeBits + 1).W)) // of the ray; dominant component ±2^(shadeBits − 1)
  val backSide = Bool()                                // the ray hits the back of the triangle
}
