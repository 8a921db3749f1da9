package colonnade.environment

import chisel3.util.log2Ceil
import colonnade.config.{AttributeLayout, ColonnadeConfig}

/** Widths of the march; f is `shadeBits`.
  *
  * Directions, projections and mantissas have f bits. The coordinates u, v and w reach 2^(f + 3), and so does the distance
  * along the ray.
  */
final class MarchFormats(config: ColonnadeConfig) {
  private val numbers = config.numbers

  val layout:    AttributeLayout = AttributeLayout.of(config)
  val f:         Int             = numbers.shadeBits
  val sceneBits: Int             = numbers.sceneBits

  /** Log2 of the map's unit in pixels. */
  val mapLog: Int = 10

  /** Fraction bits of a pixel's coordinate. */
  val pixelFraction: Int = f - mapLog

  /** Fraction bits of a plane's coefficients with exponent 0. */
  val planeFraction: Int = 22

  /** Additional fraction bits of a distance along the ray while distances are added up. */
  val guardBits:    Int = 8
  val alongBits:    Int = f + 3
  val distanceBits: Int = alongBits + guardBits

  /** Log2 of a share of w: a ray that is behind a surface by less is on it. */
  val nearLog: Int = 8

  /** A ray that crosses tiles and cells this often ends. A map of the finest cells has 31 on the longest way through a tile.
    */
  val maxSteps: Int = 512
  val stepBits: Int = log2Ceil(maxSteps + 1)

  /** Digits of a factor that is wider than the multiplier; unsigned, except for the highest. */
  val digitBits: Int = 21

  def digits(bits: Int): Int = (bits - 2) / digitBits + 1

  val originBits:    Int = f + 5
  val directionBits: Int = f + 4
  val wideBits:      Int = distanceBits - 2 + 1
  val narrowBits:    Int = (digitBits + 1).max(alongBits + 1)
  val productBits:   Int = wideBits + narrowBits

  /** A plane's depth at the ray's origin, its slope, and its depth at a distance along the ray. */
  val valueBits: Int = planeFraction + 6
  val slopeBits: Int = planeFraction + 2
  val depthBits: Int = valueBits + 2

  /** The model's widest number has 128 bits. */
  val sumBits: Int = (numbers.macBits + sceneBits + 3).min(128).max(productBits)

  /** A depth in steps of w, or a position in the scene. */
  val scaledBits:   Int = (depthBits + f - 7).max(sceneBits)
  val combineBits:  Int = scaledBits + 1
  val exponentBits: Int = 8

  /** Shift amounts, and exponents that may be negative. */
  val shiftBits: Int = 12

  /** A coordinate in tiles, with one bit to spare. */
  val tileBits: Int = 9

  /** Half the map's size in map units. */
  val centre: Seq[BigInt] = sizes.map(size => BigInt(size) << (pixelFraction - 1))

  def sizes: Seq[Int] = Seq(layout.config.width, layout.config.height)
}
