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

  val mapLog:        Int = 10         // log2 of the map's unit in pixels
  val pixelFraction: Int = f - mapLog // fraction bits of a pixel's coordinate
  val planeFraction: Int = 22         // fraction bits of a plane's coefficients with exponent 0
  val guardBits:    Int = 8 // additional fraction bits of a distance along the ray while distances are added up
  val alongBits:    Int = f + 3
  val distanceBits: Int = alongBits + guardBits
  val nearLog:      Int = 8 // log2 of a share of w: a ray that is behind a surface by less is on it

  /** A ray that crosses tiles and cells this often ends. A map of the finest cells has 31 on the longest way through a tile.
    */
  val maxSteps: Int = 512
  val stepBits: Int = log2Ceil(maxSteps + 1)

  val originBits:    Int = f + 5
  val directionBits: Int = f + 4
  val narrowBits:    Int = AttributeLayout.coefficientBits.max(alongBits + 1)

  /** A plane's depth at the ray's origin, its slope, and its depth at a distance along the ray. */
  val valueBits: Int = planeFraction + 6
  val slopeBits: Int = planeFraction + 2
  val depthBits: Int = valueBits + 2

  val wideBits:    Int = originBits.max(slopeBits).max(numbers.macBits.min(32)) // a component of the matrix
  val productBits: Int = wideBits + narrowBits

  val sumBits:      Int = (numbers.macBits + sceneBits + 3).min(128).max(productBits) // the model's widest has 128
  val scaledBits:   Int = depthBits + f - 7                                           // a depth in steps of w
  val combineBits:  Int = scaledBits + 1
  val exponentBits: Int = 8
  val shiftBits: Int = 12 // shift amounts, and exponents that may be negative
  val tileBits:  Int = 9  // a coordinate in tiles, with one bit to spare

  val centre: Seq[BigInt] = sizes.map(size => BigInt(size) << (pixelFraction - 1)) // half the map's size in map units

  def sizes: Seq[Int] = Seq(layout.config.width, layout.config.height)
}
