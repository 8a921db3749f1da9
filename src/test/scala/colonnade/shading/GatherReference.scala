package colonnade.shading

/** Gathered rays in the integers of docs/numbers.md, section 8. */
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

  /** The direction about an axis whose largest component has `shadeBits` bits, at rough metal with the width of its
    * lobe, in units of 1/256; and for the geometric normal.
    */
  def direction(axis: Seq[Int], faceForward: Seq[Int], shadeBits: Int, u: Int, v: Int, alpha: Option[Int]): Seq[Int] = {
    val frame           = new Frame(axis, shadeBits, u, v)
    val (along, across) = alpha match {
      case None        => (frame.axis.map(_ << 10), frame.point.map(component => (frame.length * component) << 3))
      case Some(alpha) =>
        val less = (alpha * ((alpha * (frame.length + frame.lift).max(0)) >> 8)) >> 8
        (frame.axis.map((frame.length - frame.lift - less) * _), frame.across(alpha))
    }
    onSide(along, across, faceForward.map(_ >> 4), isNegated = alpha.isEmpty)
  }

  /** The normal of a microfacet that a ray in the direction `dir` meets, scaled as the normal is; its width in units of
    * 1/1024.
    */
  def microfacet(normal: Seq[Int], dir: Seq[Int], shadeBits: Int, u: Int, v: Int, alpha: Int): Seq[Int] = {
    val frame = new Frame(normal, shadeBits, u, v)
    val along = frame.axis.map((frame.length - frame.lift + 1) * _)
    val found = onSide(along, frame.across(alpha).map(_ >> 3), dir.map(x => ~(x >> (shadeBits - 8))), isNegated = false)
    found.map(_ << (shadeBits - found.map(x => BigInt(x).abs.bitLength).max))
  }

  /** An axis of 11 bits, half its length, and the part of a sample point along it. */
  private class Frame(about: Seq[Int], shadeBits: Int, u: Int, v: Int) {
    private val square = about.map(component => BigInt(component) * component).sum
    val length         = math.sqrt((square >> (2 * shadeBits + 2 - 22)).toDouble).toLong
    val axis           = about.map(component => (component >> (shadeBits - 11)).toLong)
    val point          = sphere(u, v).map(_.toLong)
    val lift           = axis.zip(point).map { case (a, b) => a * b }.sum + 256 >> 9

    def across(alpha: Int): Seq[Long] = Seq.tabulate(3) { k =>
      val cross = point((k + 1) % 3) * axis((k + 2) % 3) - point((k + 2) % 3) * axis((k + 1) % 3)
      ((alpha * length + 64) >> 7) * (cross >> 8)
    }
  }

  private def onSide(along: Seq[Long], across: Seq[Long], side: Seq[Int], isNegated: Boolean): Seq[Int] = {
    def sum(sign: Int) = along.zip(across).map { case (a, b) => ((a + sign * b) >> 11).toInt }
    val first          = sum(1)
    val isOnSide       = first.zip(side).map { case (component, side) => (component >> 2) * side }.sum >= 0
    val Seq(x, y, z)   = if (isOnSide) first else if (isNegated) first.map(-_) else sum(-1)
    Seq(x, y, z | 1)
  }

  /** The direction in which a smooth mirror would reflect, scaled to `shadeBits` bits. */
  def lobeAxis(normal: Seq[Int], dir: Seq[Int], shadeBits: Int): Seq[Int] = {
    val Seq(n, d) = Seq(normal, dir).map(_.map(component => BigInt(component >> (shadeBits - 12))))
    val square    = n.map(component => component * component).sum
    val against   = BigInt(0).max(-n.zip(d).map { case (a, b) => a * b }.sum)
    val drop      = square.bitLength - 12
    val sum       = n.zip(d).map { case (n, d) => (square >> drop) * d + 2 * (against >> drop) * n }
    val shift     = sum.map(_.abs.bitLength).max - shadeBits
    sum.map(component => (if (shift < 0) component << -shift else component >> shift).toInt)
  }

  /** How brightly rough metal shows a light, with `fraction` fraction bits. */
  def share(cosine: Int, slope: Int, peak: Int, fraction: Int): BigInt = {
    val length    = (BigInt(1) << (fraction + 6)) + BigInt(slope) * ((1 << fraction) - cosine)
    val octaves   = length.bitLength - 1 - (fraction + 6)
    val mantissa  = ((length << 7) >> (length.bitLength - 1)).toInt & 127
    val logarithm =
      peak - 256 - 2 * (128 * octaves + math.rint(128 * math.log(1 + (mantissa + 0.5) / 128) / math.log(2)).toInt)
    val exponent = logarithm >> 7
    val power    = BigInt(math.rint(256 * math.pow(2, (logarithm & 127) / 128.0)).toInt)
    if (exponent > 5) (BigInt(1) << (fraction + 6)) - 1 else (power << (fraction + 64)) >> (8 + 64 - exponent)
  }

  /** The address of the texel of the light cube that a ray meets from an origin in grid steps of `gridBits` bits. */
  def texel(origin: Seq[BigInt], direction: Seq[BigInt], parallax: Int, gridBits: Int): Int = {
    val length = direction.map(_.abs.bitLength).max
    val dir    =
      direction.map(component => (if (length < 8) component << (8 - length) else component >> (length - 8)).toInt)
    val scaled = dir.zip(origin).map { case (component, position) =>
      val offset = (position - (BigInt(1) << gridBits - 4)) >> gridBits - 9 + parallax
      val factor = dir.map(component => component.max(-1 - component) >> 5).max
      (2 * component + 1 + (if (parallax == 0) 0 else (2 * offset.max(-32).min(31).toInt + 1) * factor)) >> 2
    }
    val sizes                     = scaled.map(_.abs)
    val axis                      = sizes.indexOf(sizes.max)
    val major                     = sizes(axis)
    def part(component: Int): Int = if (major == 0) 15 else ((component + major) * 8 / major).min(15)
    val face                      = 2 * axis + (if (scaled(axis) < 0) 1 else 0)
    (face * 16 + part(scaled((axis + 1) % 3))) * 16 + part(scaled((axis + 2) % 3))
  }

  /** The sample point of a pixel: the xor of the columns of two generator matrices of Sobol's sequence, in Morton
    * order.
    */
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
