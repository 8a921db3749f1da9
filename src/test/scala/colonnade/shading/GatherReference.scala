package colonnade.shading

/** Gathered rays in the integers of docs/gather.md. */
object GatherReference {

  /** The point of the unit sphere of a sample point, with 8 fraction bits. */
  def sphere(u: Int, v: Int): Seq[Int] = {
    val z                  = 255 - 2 * u
    val radius             = math.rint(math.sqrt(65536.0 - z * z)).toInt
    val (quarter, index)   = (v >> 6, v & 63)
    def cosine(index: Int) = math.rint(256 * math.cos((index + 0.5) * math.Pi / 128)).toInt
    def across(index: Int) = (radius * cosine(index) + 128) >> 8
    val x                  = across(if (quarter % 2 == 0) index else 63 - index)
    val y                  = across(if (quarter % 2 == 0) 63 - index else index)
    Seq(if (quarter == 1 || quarter == 2) -x else x, if (quarter >= 2) -y else y, z)
  }

  /** The direction for a normal whose largest component has `shadeBits` bits, and for the geometric normal. */
  def direction(normal: Seq[Int], faceForward: Seq[Int], shadeBits: Int, u: Int, v: Int): Seq[Int] = {
    val square = normal.map(component => BigInt(component) * component).sum
    val length = math.sqrt((square >> (2 * shadeBits + 2 - 24)).toDouble).toLong
    val sum    = normal.zip(sphere(u, v)).map { case (component, point) =>
      ((length * point + ((component >> (shadeBits - 12)).toLong << 7)) >> 4).toInt
    }
    val side = sum.zip(faceForward).map { case (component, geometric) => (component >> 8) * (geometric >> 4) }.sum
    val Seq(x, y, below) = if (side < 0) sum.map(-_) else sum
    Seq(x, y, below | 1)
  }

  /** The address of the texel of the light cube that a direction meets. */
  def texel(direction: Seq[BigInt]): Int = {
    val length = direction.map(_.abs.bitLength).max
    val scaled =
      direction.map(component => (if (length < 8) component << (8 - length) else component >> (length - 8)).toInt)
    val sizes                     = scaled.map(_.abs)
    val axis                      = sizes.indexOf(sizes.max)
    val major                     = sizes(axis)
    def part(component: Int): Int = if (major == 0) 7 else ((component + major) * 4 / major).min(7)
    val face                      = 2 * axis + (if (scaled(axis) < 0) 1 else 0)
    (face * 8 + part(scaled((axis + 1) % 3))) * 8 + part(scaled((axis + 2) % 3))
  }

  /** The sample point of a pixel: the xor of the columns of two generator matrices of Sobol's sequence, in Morton order. */
  def pixel(x: Int, y: Int): (Int, Int) = {
    val dimensions = Seq(
      (Seq(1, 3), (m: Seq[Int]) => (m(0) ^ (m(0) << 2)) ^ (m(1) << 1)),
      (
        Seq(1, 3, 1),
        (m: Seq[Int]) => (m(0) ^ (m(0) << 3)) ^ (m(1) << 2)
      )
    )
    val Seq(u, v) = dimensions.map { case (first, next) =>
      val numbers = Iterator.iterate(first)(m => m.tail :+ next(m)).map(_.head).take(20).toSeq
      (0 until 20).filter(bit => ((if (bit % 2 == 0) x else y) >> (bit / 2) & 1) == 1).map { bit =>
        ((numbers(bit).toLong << 8) >> (bit + 1)).toInt
      }.fold(0)(_ ^ _)
    }
    (u, v)
  }
}
