package colonnade.shading

import chisel3._
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{RecordFormats, Vec3}
import colonnade.ray.Context

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

  /** Operands of the multiplier, signed. The narrow one takes a scaled component or a light's intensity, the wide one
    * also a distance or a colour's sum.
    */
  val narrowBits:  Int = shadeBits + 1
  val wideBits:    Int = numbers.gridBits.max(shadeBits + 1).max(NumberFormats.lightBits + 2)
  val productBits: Int = wideBits + narrowBits

  /** Digits of `shadeBits` bits, least significant first, in which a slope is multiplied; the last one is signed. */
  val slopeDigits: Int = (numbers.gridBits - 2) / shadeBits + 1

  /** A dot product of two scaled vectors: three products of components of at most 2^shadeBits. */
  val dotBits: Int = 2 * shadeBits + 2

  /** The product of both lengths' mantissas; it lacks at most one bit. */
  val lengthsBits: Int = 2 * shadeBits

  /** A cosine, from 0 to 1 inclusive. */
  val cosineBits: Int = numbers.cosineFraction + 1
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

/** What the geometry part of the shader finds out. */
final class ShadingPoint(config: ColonnadeConfig) extends Bundle {
  private val formats = new ShaderFormats(config.numbers)

  val context  = Context(config)
  val material = UInt(RecordFormats.materialBits.W)

  /** The shadow ray's origin, above the surface, and its way to the light: grid steps. */
  val origin  = Vec3(SInt(formats.pointBits.W))
  val toLight = Vec3(SInt(formats.toLightBits.W))

  /** Between the shading normal and the way to the light. */
  val angle = new Angle(formats)
}
