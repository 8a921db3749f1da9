package colonnade.shading

import chisel3._
import colonnade.common.Context
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{FrameRegisters, Vec3}
import colonnade.numbers.{Fixed, FixedPointFormat}
import colonnade.ray.RayFormats

/** Widths of reflection and refraction, by the bounds that docs/bounce.md gives for what they hold. */
final class BounceFormats(numbers: NumberFormats) {
  val shadeBits: Int = numbers.shadeBits

  /** A component of a scaled normal or of the ray's direction, signed. */
  val componentBits: Int = shadeBits + 1

  /** A component of a normal that is turned against the ray, signed. */
  val facingBits: Int = NumberFormats.normalBits + 1

  /** A component of the ray that goes on, signed. */
  val bounceBits: Int = shadeBits + 5

  /** The factors of the ray's direction (unsigned) and of the normal (signed) whose sum goes on: in a refraction with
    * three bits more than in a reflection, the index's integer part.
    */
  val parallelBits: Int = shadeBits + 3
  val acrossBits:   Int = shadeBits + 5

  /** The cosine's factor in a reflection, and the direction's squared length; unsigned. */
  val alongBits:  Int = shadeBits + 1
  val squareBits: Int = shadeBits + 1

  /** A squared index, unsigned. */
  val etaSquareBits: Int = 2 * NumberFormats.etaBits - NumberFormats.etaFraction

  /** Low bits that squared lengths lose so that they fit the multiplier, and how long they are before: unsigned. */
  val lengthBits: Int = 2 * shadeBits + 1
  val low:        Int = (lengthBits - numbers.rootBits).max(0)

  /** How many times a squared length is quartered, at most, to fit the square root. */
  val quarters: Int = ((lengthBits - numbers.radicandBits + 1) / 2).max(0)

  /** Factors, signed: one at once, the other one digit by digit, most significant first. Most need two digits, long ones
    * (a squared length, an offset) more.
    */
  val wideBits:   Int = acrossBits.max(etaSquareBits + 1)
  val digitBits:  Int = 11
  val digits:     Int = 2
  val longBits:   Int = (numbers.gridBits - 1).max(numbers.rootBits + 1).max(digits * digitBits)
  val longDigits: Int = (longBits + digitBits - 1) / digitBits
  require((shadeBits + 2).max(etaSquareBits + 1) <= digits * digitBits, "a factor has more than two digits")

  val productBits: Int = wideBits + longBits

  /** Signed: a dot product and a bit to tell its length by; what is left of a squared length after an index's square;
    * an offset's product.
    */
  val sumBits: Int = (2 * shadeBits + 3).max(numbers.rootBits + 8).max(numbers.gridBits + 10)
}

/** A hit on a mirror or on glass. */
final class BounceRequest(config: ColonnadeConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new BounceFormats(numbers)

  val context = Context(config)

  /** Where a reflection starts, off the surface: the hit point plus nearestEven(offset · facing); grid steps. */
  val origin = Vec3(SInt(new ShaderFormats(numbers).pointBits.W))

  /** The shading normal, turned against the ray; its largest component takes `shadeBits` bits, or it is zero. */
  val normal = Vec3(SInt(formats.componentBits.W))

  /** `normal` is the vertices', and not yet the geometric one. */
  val isSmooth = Bool()

  /** The geometric normal, turned against the ray. */
  val facing = Vec3(SInt(formats.facingBits.W))

  /** The ray's direction, its dominant component ±2^(shadeBits − 1). */
  val towards  = Vec3(SInt(formats.componentBits.W))
  val backSide = Bool()

  /** Otherwise it is a mirror; then nothing below matters. */
  val isGlass = Bool()

  /** Of the side that the ray comes from. */
  val eta = new Fixed(FixedPointFormat.unsigned(NumberFormats.etaBits, NumberFormats.etaFraction))

  /** Head-on. */
  val reflectance = FrameRegisters.share
}

/** Where a ray goes on. */
final class BounceResult(config: ColonnadeConfig) extends Bundle {
  private val numbers = config.numbers

  val context      = Context(config)
  val isRefraction = Bool()
  val origin       = Vec3(new Fixed(new RayFormats(numbers).scene))

  /** The direction, of any scale. */
  val towards = Vec3(SInt(numbers.directionBits.W))

  /** Where a refracted ray's reflected share comes from; 0 is none. */
  val reflection = Vec3(SInt(new BounceFormats(numbers).bounceBits.W))
  val share      = FrameRegisters.share
}
