package colonnade.shading

import chisel3._
import chisel3.util.log2Ceil
import colonnade.common.Context
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{RecordFormats, Vec3}

/** Widths inside the shader, by the bounds that docs/numbers.md gives for what they hold. */
final class ShaderFormats(numbers: NumberFormats) {
  val shadeBits: Int = numbers.shadeBits

  /** Hit points and origins of shadow rays, signed: a grid position, a distance times a slope below two, and an offset
    * of at most a quarter of the grid's range.
    */
  val pointBits: Int = numbers.gridBits + 2

  /** The way to the light, signed: a difference of scene positions. */
  val toLightBits: Int = numbers.sceneBits + 1

  /** The sum of three weighted normals, signed. */
  val normalSumBits: Int = numbers.barycentricBits + NumberFormats.normalBits + 2

  /** A shading normal before and after its scaling, signed. */
  val normalBits: Int = normalSumBits.max(shadeBits + 1)

  /** The widest component of a vector, signed. */
  val vectorBits: Int = toLightBits.max(normalBits)

  /** A cosine, from 0 to 1 inclusive. */
  val cosineBits: Int = numbers.cosineFraction + 1

  /** A cosine times a falloff. */
  val brightnessBits: Int = cosineBits + Falloff.integerBits

  /** Operands of the multiplier, signed. The narrow one takes a scaled component or a light's intensity, the wide one
    * also a distance or a colour's sum.
    */
  val narrowBits:  Int = shadeBits + 1
  val wideBits:    Int = numbers.gridBits.max(shadeBits + 1).max(brightnessBits + 1)
  val productBits: Int = wideBits + narrowBits

  /** Digits of `shadeBits` bits, least significant first, in which a slope is multiplied; the last one is signed. */
  val slopeDigits: Int = (numbers.gridBits - 2) / shadeBits + 1

  /** A dot product of two scaled vectors: three products of components of at most 2^shadeBits. */
  val dotBits: Int = 2 * shadeBits + 2

  /** The product of both lengths' mantissas; it lacks at most one bit. */
  val lengthsBits: Int = 2 * shadeBits

  /** Log2 of a light's reach over its distance, both squared. */
  val falloffExponentBits: Int =
    NumberFormats.bitLength(4 * numbers.sceneBits + 2 * shadeBits + numbers.mantissaBits) + 2

}

object ShaderFormats {

  /** Where shadow rays start, signed: off the object, or off the room. */
  def originBits(config: ColonnadeConfig): Int = {
    val ofObject = new ShaderFormats(config.numbers).pointBits
    if (config.hasRoom) config.numbers.sceneBits.max(ofObject) else ofObject
  }
}

/** Two numbers to multiply. */
final class Factors(formats: ShaderFormats) extends Bundle {
  val wide   = SInt(formats.wideBits.W)
  val narrow = SInt(formats.narrowBits.W)
}

/** The angle between two vectors a and b that are scaled so that the largest component takes `shadeBits` bits.
  *
  * @note a·a = u · 2^(k - 1 + shadeBits) with a mantissa u of `shadeBits` bits and k from 0 to 3; b·b likewise.
  */
final class Angle(formats: ShaderFormats) extends Bundle {

  /** a·b is positive. Without it the rest is meaningless. */
  val isAcute = Bool()
  val dot     = UInt(formats.dotBits.W)

  /** The product of both mantissas u. */
  val lengths = UInt(formats.lengthsBits.W)

  /** The sum of both k. */
  val exponent = UInt(3.W)
}

/** How much of a light's colour is left at a distance, from 0 to 4. */
object Falloff {
  val integerBits: Int = 3
  val bits:        Int = integerBits + NumberFormats.lightFraction

  def apply(): UInt = UInt(bits.W)

  def one: UInt = (1 << NumberFormats.lightFraction).U(bits.W)

  def most: UInt = (4 << NumberFormats.lightFraction).U(bits.W)
}

/** What a light's falloff is made of: `mantissa`, of `shadeBits` bits, is that of the squared distance.
  *
  * @note falloff = reach · 2^exponent / mantissa, both mantissas taken as numbers from a half to one
  */
final class FalloffQuestion(numbers: NumberFormats) extends Bundle {
  private val formats = new ShaderFormats(numbers)

  /** 0: the light is the same everywhere. */
  val reach    = UInt(numbers.mantissaBits.W)
  val mantissa = UInt(formats.shadeBits.W)
  val exponent = SInt(formats.falloffExponentBits.W)
}

/** What the geometry part of the shader finds out of one hit and one light. */
final class ShadingPoint(config: ColonnadeConfig) extends Bundle {
  private val formats = new ShaderFormats(config.numbers)

  /** The light, and whether it is the hit's last one. */
  val light  = UInt(log2Ceil(config.frame.lights.max(2)).W)
  val isLast = Bool()

  /** Between the shading normal and the way to the light. */
  val angle   = new Angle(formats)
  val falloff = new FalloffQuestion(config.numbers)

  /** Of the hit, whatever the light. */
  val surface = new ShadedSurface(config)
}

/** A hit, and the ray that has met it. */
final class ShadedSurface(config: ColonnadeConfig) extends Bundle {
  private val formats = new ShaderFormats(config.numbers)

  val context  = Context(config)
  val material = UInt(RecordFormats.materialBits.W)

  /** It is the room's. */
  val isRoom = Bool()

  /** Where shadow rays and reflections start, off the surface: grid steps. */
  val origin = Vec3(SInt(ShaderFormats.originBits(config).W))

  /** The shading normal against the ray, its largest component of `shadeBits` bits; and whether it is the vertices'. */
  val normal   = Vec3(SInt(formats.narrowBits.W))
  val isSmooth = Bool()

  /** The geometric normal against the ray. */
  val facing = Vec3(SInt((NumberFormats.normalBits + 1).W))

  /** The ray's direction; its dominant component is ±2^(shadeBits − 1). */
  val towards  = Vec3(SInt((formats.shadeBits + 1).W))
  val backSide = Bool()
}
