package colonnade.shading

import chisel3._
import chiseltest._
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.numbers.Fixed

import scala.util.Random

/** A hit on a mirror or glass in raw integers: the model's input for "bounce". `shear` and `negative` are in the ray's
  * frame, everything else is in the object's.
  */
final case class BounceCase(
    context:         Int,
    axis:            Int,
    negative:        Boolean,
    shear:           Seq[BigInt],
    point:           Seq[BigInt],
    weights:         Seq[BigInt],
    backSide:        Boolean,
    normals:         Seq[Seq[BigInt]],
    geometricNormal: Seq[BigInt],
    isFlat:          Boolean,
    isGlass:         Boolean,
    etas:            Seq[BigInt],
    reflectance:     BigInt
) {
  private def faceForward(vector: Seq[BigInt]): Seq[BigInt] = if (backSide) vector.map(-_) else vector

  /** The object's axes in the order of the ray's frame. */
  private val axes = Seq(1, 2, 3).map(i => (axis + i) % 3)

  val faceForwardNormal: Seq[BigInt] = faceForward(geometricNormal)
  val smooth: Seq[BigInt] = faceForward(Seq(0, 1, 2).map(a => normals.zip(weights).map { case (n, w) => n(a) * w }.sum))
  val isSmooth: Boolean = !isFlat && smooth.exists(_ != 0)
  val eta:      BigInt  = etas(if (backSide) 1 else 0)

  /** The ray's direction; its dominant component is ±2^(shadeBits − 1). */
  def dir(numbers: NumberFormats): Seq[BigInt] = {
    val drop = numbers.shearFraction - (numbers.shadeBits - 1)
    val one  = BigInt(1) << (numbers.shadeBits - 1)
    val own  = shear.map(BounceStimulus.floor(_, drop)) :+ (if (negative) -one else one)
    Seq(0, 1, 2).map(a => own(axes.indexOf(a)))
  }

  /** Block-normalised to `shadeBits` bits. */
  def normal(numbers: NumberFormats): Seq[BigInt] = {
    val from = if (isSmooth) smooth else faceForwardNormal
    val drop = from.map(_.abs.bitLength).max - numbers.shadeBits
    from.map(BounceStimulus.floor(_, drop))
  }

  /** Positive if the geometric normal is turned against the ray. */
  def against(numbers: NumberFormats): BigInt =
    -faceForwardNormal.zip(dir(numbers)).map { case (f, d) => f * d }.sum

  /** A reflection's origin. */
  def origin(offset: BigInt): Seq[BigInt] = point.zip(faceForwardNormal).map { case (p, f) =>
    p + BounceStimulus.nearestEven(offset * f, NumberFormats.normalFraction)
  }

  /** The model's input words, for a hit at the ray's origin. */
  def words(offset: BigInt): Seq[BigInt] = {
    def bit(claim: Boolean): BigInt = if (claim) 1 else 0
    (BigInt(axis) +: Seq.fill(3)(bit(negative))) ++ axes.map(point(_)) ++ shear ++ (BigInt(0) +: weights) ++
      (bit(backSide) +: normals.flatten) ++ geometricNormal ++
      Seq(offset, bit(isFlat), BigInt(if (isGlass) 2 else 1)) ++ etas :+ reflectance
  }
}

object BounceStimulus {
  def floor(x: BigInt, bits: Int): BigInt = if (bits >= 0) x >> bits else x << -bits

  def nearestEven(x: BigInt, bits: Int): BigInt = {
    val (quotient, half) = (x >> bits, BigInt(1) << (bits - 1))
    val rest             = x - (quotient << bits)
    if (rest > half || (rest == half && quotient.testBit(0))) quotient + 1 else quotient
  }

  /** Offers a hit, for a register `shading.offset`. */
  def poke(config: ColonnadeConfig, offset: BigInt)(port: BounceRequest, hit: BounceCase): Unit = {
    val numbers                                         = config.numbers
    def set(to:   Seq[SInt], values: Seq[BigInt]): Unit = to.zip(values).foreach { case (to, value) => to.poke(value) }
    def fixed(to: Fixed, value:      BigInt): Unit      = to.raw.asInstanceOf[UInt].poke(value)
    port.context.poke(hit.context)
    set(port.origin.axes, hit.origin(offset))
    set(port.normal.axes, hit.normal(numbers))
    port.isSmooth.poke(hit.isSmooth)
    set(port.faceForwardNormal.axes, hit.faceForwardNormal)
    set(port.dir.axes, hit.dir(numbers))
    port.backSide.poke(hit.backSide)
    port.isGlass.poke(hit.isGlass)
    fixed(port.eta, hit.eta)
    fixed(port.reflectance, hit.reflectance)
  }
}

/** Random bounces of all kinds, and bounces close to a decision. */
final class BounceStimulus(config: ColonnadeConfig, random: Random) {
  private val numbers  = config.numbers
  private val one      = 1 << NumberFormats.etaFraction
  private val steepest = BigInt(1) << numbers.shearFraction

  private def chance(oneIn: Int): Boolean = random.nextInt(oneIn) == 0

  private def xyz[T](value: => T): Seq[T] = Seq.fill(3)(value)

  private def natural(bits: Int): BigInt =
    if (chance(8)) BigInt(0) else if (chance(8)) (BigInt(1) << bits) - 1 else BigInt(random.nextInt(bits) + 1, random)

  private def signed(bits: Int): BigInt =
    if (chance(16)) -(BigInt(1) << (bits - 1)) else natural(bits - 1) * (if (random.nextBoolean()) 1 else -1)

  private def unit(vector: Seq[Double]): Seq[BigInt] = {
    val length = math.sqrt(vector.map(x => x * x).sum)
    vector.map(x => BigInt(math.round(x / length * 2047)))
  }

  private def anyUnit: Seq[BigInt] = unit(xyz(random.nextGaussian()))

  private def nearly(vector: Seq[BigInt], by: Double): Seq[BigInt] =
    unit(vector.map(_.toDouble + random.nextGaussian() * by + 1e-3))

  private def eta: BigInt =
    if (chance(8)) natural(NumberFormats.etaBits)
    else BigInt(((if (random.nextBoolean()) 1.5 else 1 / 1.5) * (0.7 + random.nextDouble()) * one).toInt)

  private def reflectance: BigInt = if (chance(8)) BigInt(4096) else BigInt(random.nextInt(4097))

  /** Of any size; half of them such that their products with odd components are halfway between two steps. */
  def offset(): BigInt =
    if (random.nextBoolean()) natural(numbers.gridBits - 2)
    else {
      val below = NumberFormats.normalFraction
      ((BigInt(numbers.gridBits - 2 - below, random) << 1) + 1) << (below - 1)
    }

  /** Components of any size, independent of each other. */
  def any(): BounceCase = BounceCase(
    context = random.nextInt(config.units.pathContexts),
    axis = random.nextInt(3),
    negative = random.nextBoolean(),
    shear = Seq.fill(2)(if (chance(8)) steepest else natural(numbers.shearFraction)).map(s =>
      if (random.nextBoolean()) s else -s
    ),
    point = xyz(signed(numbers.gridBits)),
    weights = xyz(natural(numbers.barycentricBits)),
    backSide = random.nextBoolean(),
    normals = xyz(xyz(signed(NumberFormats.normalBits))),
    geometricNormal = xyz(signed(NumberFormats.normalBits)),
    isFlat = chance(3),
    isGlass = !chance(3),
    etas = Seq.fill(2)(if (chance(3)) natural(NumberFormats.etaBits) else eta),
    reflectance = reflectance
  )

  /** Unit normals; the vertices' normals are near the geometric one. */
  def surface(spread: Double = 200): BounceCase = {
    val slopes = Seq.fill(2)(BigInt(((random.nextDouble() * 2 - 1) * steepest.toDouble).toLong))
    val plain  = any().copy(shear = slopes, etas = Seq.fill(2)(eta))
    val normal = anyUnit
    val turned = plain.copy(geometricNormal = normal, normals = xyz(nearly(normal, spread)))
    turned.copy(backSide = turned.copy(backSide = false).against(numbers) < 0)
  }

  /** A grazing ray: the vertices' normals turn away from it, or reflect it into the surface. */
  def grazing(): BounceCase = {
    val plain  = surface()
    val along  = plain.dir(numbers).map(_.toDouble)
    val any    = anyUnit.map(_.toDouble)
    val length = along.map(x => x * x).sum
    val part   = along.zip(any).map { case (a, b) => a * b }.sum / length
    val across = unit(any.zip(along).map { case (b, a) => b - part * a + 1e-6 })
    val normal = if (random.nextBoolean()) across else nearly(across, 60)
    val turned = plain.copy(geometricNormal = normal, normals = xyz(nearly(normal, 150)))
    turned.copy(backSide = turned.copy(backSide = false).against(numbers) < 0)
  }

  /** An index of refraction close to total internal reflection. */
  def critical(): BounceCase = {
    val plain    = surface().copy(isGlass = true, isFlat = random.nextBoolean())
    val (d, n)   = (plain.dir(numbers).map(_.toDouble), plain.normal(numbers).map(_.toDouble))
    val product  = d.zip(n).map { case (a, b) => a * b }.sum
    val cosine   = product * product / d.map(x => x * x).sum / n.map(x => x * x).sum
    val critical = one / math.sqrt((1 - cosine).max(1e-6))
    val near     = BigInt(math.round(critical).min((1L << NumberFormats.etaBits) - 3).toInt + random.nextInt(7) - 3)
    plain.copy(etas = xyz(near.min(65535)).take(2))
  }

  /** Normal incidence with an index of about one: the direction does not change. */
  def straight(): BounceCase = {
    val axis   = random.nextInt(3)
    val sign   = if (random.nextBoolean()) 1 else -1
    val normal = Seq.tabulate(3)(i => BigInt(if (i == axis) 2047 * sign else 0))
    any().copy(
      axis = axis,
      negative = sign > 0,
      shear = Seq.fill(2)(BigInt(random.nextInt(3) - 1)),
      normals = xyz(normal),
      geometricNormal = normal,
      backSide = false,
      etas = Seq(BigInt(one + random.nextInt(3) - 1), BigInt(one))
    )
  }

  /** Along the normal. The product of normal and ray is a power of two, or a little more. The product of their lengths
    * is less, without the bits that are dropped. So the mantissa of the quotient is a half, and the cosine is one.
    */
  def perpendicular(): BounceCase = {
    def product(a: Seq[BigInt], b: Seq[BigInt]) = a.zip(b).map { case (x, y) => x * y }.sum.abs
    def squared(vector: Seq[BigInt])            = {
      val square = product(vector, vector)
      val low    = square.bitLength - numbers.shadeBits
      square >> low << low
    }
    Iterator.continually {
      val normal = anyUnit
      val axis   = normal.indices.maxBy(normal(_).abs)
      val hit    = any().copy(
        axis = axis,
        negative = normal(axis) > 0,
        shear = Seq(1, 2).map(i => -normal((axis + i) % 3) * steepest / normal(axis).abs),
        backSide = false,
        normals = xyz(normal),
        geometricNormal = normal,
        isFlat = false,
        isGlass = true
      )
      val along  = product(normal, hit.dir(numbers))
      val weight = ((BigInt(1) << (along.bitLength + numbers.barycentricBits)) + along - 1) / along
      hit.copy(weights = Seq(weight / 3, weight / 3, weight - weight / 3 * 2))
    }.find { hit =>
      val (normal, dir) = (hit.normal(numbers), hit.dir(numbers))
      squared(normal) * squared(dir) < (BigInt(1) << (2 * (product(normal, dir).bitLength - 1)))
    }.get
  }

  /** The vertices' normals cancel, or all normals are zero. */
  def withoutNormal(): BounceCase = {
    val plain = if (random.nextBoolean()) surface().copy(weights = xyz(BigInt(0))) else any()
    if (chance(2)) plain else plain.copy(geometricNormal = xyz(BigInt(0)))
  }

  /** Every number at an end of its range. */
  def extreme(): BounceCase = {
    def end(bits: Int): BigInt = if (random.nextBoolean()) -(BigInt(1) << (bits - 1)) else (BigInt(1) << (bits - 1)) - 1
    any().copy(
      shear = Seq.fill(2)(if (random.nextBoolean()) steepest else -steepest),
      point = xyz(end(numbers.gridBits)),
      weights = xyz((BigInt(1) << numbers.barycentricBits) - 1),
      normals = xyz(xyz(end(NumberFormats.normalBits))),
      geometricNormal = xyz(end(NumberFormats.normalBits)),
      etas = Seq.fill(2)(BigInt(Seq(0, 1, 8191, 8192, 8193, 65535)(random.nextInt(6)))),
      reflectance = Seq(BigInt(0), BigInt(4096), BigInt(8191))(random.nextInt(3))
    )
  }
}
