package colonnade.environment

import colonnade.config.{AttributeLayout, ColonnadeConfig}

/** Widths of the march, by the bits of what they hold; f is `shadeBits`.
  *
  * Directions, projections and mantissas have f bits; u, v and w reach 2^(f + 3), and so does the distance along the
  * ray.
  */
final class MarchFormats(config: ColonnadeConfig) {
  private val numbers = config.numbers

  val layout:    AttributeLayout = AttributeLayout.of(config)
  val f:         Int             = numbers.shadeBits
  val sceneBits: Int             = numbers.sceneBits

  /** Log2 of the map's unit in pixels. */
  val mapLog: Int = 10

  /** Fraction bits of a pixel's coordinate. */
  val toPixel: Int = f - mapLog

  /** Of a plane's coefficients with exponent 0. */
  val planeFraction: Int = 22

  /** More bits of a distance along the ray while it is summed up. */
  val guardBits: Int = 8
  val alongBits: Int = f + 3
  val wayBits:   Int = alongBits + guardBits

  /** A ray that is less than this share of w behind a surface is on it, log2. */
  val nearLog:   Int = 5
  val mostSteps: Int = 128
  val stepBits:  Int = 8

  /** Digits of a factor that is wider than the multiplier: unsigned, but for the highest. */
  val digitBits: Int = 21

  def digits(bits: Int): Int = (bits - 2) / digitBits + 1

  val placeBits:     Int = f + 5
  val directionBits: Int = f + 4
  val wideBits:      Int = wayBits - 2 + 1
  val narrowBits:    Int = (digitBits + 1).max(alongBits + 1)
  val productBits:   Int = wideBits + narrowBits

  /** A depth's value, and its value at a distance along the ray. */
  val valueBits: Int = planeFraction + 6
  val slopeBits: Int = planeFraction + 2
  val depthBits: Int = valueBits + 2

  /** The model's widest number has 128 bits. */
  val sumBits: Int = (numbers.macBits + sceneBits + 3).min(128).max(productBits)

  /** A depth in steps of w, or a position in the scene. */
  val scaledBits:   Int = (depthBits + f - 7).max(sceneBits)
  val combineBits:  Int = scaledBits + 1
  val lengthBits:   Int = 8
  val exponentBits: Int = 12

  /** Of a coordinate in tiles, one more than needed. */
  val tileBits: Int = 9

  /** Half the map's size in map units. */
  val centre: Seq[BigInt] = sizes.map(size => BigInt(size) << (toPixel - 1))

  def sizes: Seq[Int] = Seq(layout.config.width, layout.config.height)
}
