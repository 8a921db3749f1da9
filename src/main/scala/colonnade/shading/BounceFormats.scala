package colonnade.shading

import chisel3._
import colonnade.common.Context
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{FrameRegisters, Vec3}
import colonnade.numbers.{Fixed, FixedPointFormat}

/** Widths of reflection and refraction, from the bounds in docs/shading.md. */
final class BounceFormats(numbers: NumberFormats) {
  val shadeBits:     Int = numbers.shadeBits
  val componentBits: Int = shadeBits + 1 // a component of a scaled normal or of the ray's direction, signed
  val faceForwardBits: Int = NumberFormats.normalBits + 1 // a component of a normal turned against the ray, signed
  val bounceBits:      Int = shadeBits + 5                // a component of the outgoing ray's direction, signed

  /** Factors of the ray's direction (unsigned) and of the normal (signed) in the outgoing direction. A refraction needs
    * three bits more than a reflection, for the integer part of the index.
    */
  val directionScaleBits: Int = shadeBits + 3
  val normalScaleBits:    Int = shadeBits + 5

  /** The cosine's factor in a reflection, and the direction's squared length; unsigned. */
  val cosineBits: Int = shadeBits + 1
  val squareBits: Int = shadeBits + 1

  val etaSquareBits: Int = 2 * NumberFormats.etaBits - NumberFormats.etaFraction // a squared relative index, unsigned

  /** The product of two squared lengths, unsigned; and the low bits that it drops to fit the multiplier. */
  val lengthBits: Int = 2 * shadeBits + 1
  val low:        Int = (lengthBits - numbers.rootBits).max(0)

  /** The most times that a discriminant is divided by four to fit the square root. */
  val quarters: Int = ((lengthBits - numbers.radicandBits + 1) / 2).max(0)

  /** Factors, signed. The wide one is multiplied as a whole, the long one digit by digit, most significant first. Most
    * need two digits; a squared length and an offset need more.
    */
  val wideBits:   Int = normalScaleBits.max(etaSquareBits + 1)
  val digitBits:  Int = 11
  val digits:     Int = 2
  val longBits:   Int = (numbers.gridBits - 1).max(numbers.rootBits + 1).max(digits * digitBits)
  val longDigits: Int = (longBits + digitBits - 1) / digitBits
  require((shadeBits + 2).max(etaSquareBits + 1) <= digits * digitBits, "a factor has more than two digits")

  val productBits: Int = wideBits + longBits

  /** The widest of: a dot product with one bit to measure its length, the discriminant, and the offset's product;
    * signed.
    */
  val sumBits: Int = (2 * shadeBits + 3).max(numbers.rootBits + 8).max(numbers.gridBits + 10)
}

/** A hit on a mirror or on glass. */
final class BounceRequest(config: PathConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new BounceFormats(numbers)

  val context = Context(config)

  /** A reflection's origin: the hit point plus nearestEven(offset · faceForwardNormal); grid steps. */
  val origin = Vec3(SInt(new ShaderFormats(numbers).pointBits.W))

  /** The shading normal, turned against the ray; its largest component has `shadeBits` bits, or it is zero. */
  val normal = Vec3(SInt(formats.componentBits.W))

  val isSmooth = Bool() // `normal` is interpolated from the vertices' normals; otherwise it is geometric
  val faceForwardNormal = Vec3(SInt(formats.faceForwardBits.W)) // the geometric normal, turned against the ray
  val dir               = Vec3(SInt(formats.componentBits.W))   // of the ray; dominant component ±2^(shadeBits − 1)
  val backSide          = Bool()                                // the ray hits the back of the triangle
  val isGlass           = Bool()                                // glass, or a mirror, which ignores the fields below

  /** The relative index of refraction, for a ray from this side. */
  val eta = new Fixed(FixedPointFormat.unsigned(NumberFormats.etaBits, NumberFormats.etaFraction))

  val reflectance = FrameRegisters.weight // at normal incidence
}

/** The ray that leaves a mirror or glass. */
final class BounceResult(config: PathConfig) extends Bundle {
  private val dirType = Vec3(SInt(new BounceFormats(config.numbers).bounceBits.W))

  val context      = Context(config)
  val isRefraction = Bool()

  /** Of a refracted ray, grid steps. A reflection starts at the origin of its request. */
  val origin = Vec3(SInt(new ShaderFormats(config.numbers).pointBits.W))

  val dir = dirType.cloneType // the direction, of any scale

  /** The direction of a refracted ray's reflection, and its Fresnel term; a term of 0: there is no reflection. */
  val reflection = dirType.cloneType
  val fresnel    = FrameRegisters.weight
}
