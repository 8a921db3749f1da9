package colonnade.shading

import colonnade.config.{ColonnadeConfig, NumberFormats}

import scala.util.Random

/** A hit in raw integers: the model's input for "shade". */
final case class HitCase(
    context:         Int,
    axis:            Int,
    negative:        Seq[Boolean],
    origin:          Seq[BigInt],
    shear:           Seq[BigInt],
    t:               BigInt,
    weights:         Seq[BigInt],
    backSide:        Boolean,
    normals:         Seq[Seq[BigInt]],
    geometricNormal: Seq[BigInt],
    colours:         Seq[Seq[BigInt]],
    material:        Int
)

/** A point of an environment: the model's input for "lightenvironment". */
final case class EnvironmentPointCase(
    context: Int,
    point:   Seq[BigInt],
    normal:  Seq[BigInt],
    albedo:  Seq[BigInt],
    shadows: Boolean
)

/** A light, in raw integers. */
final case class LightSource(position: Seq[BigInt], colour: Seq[BigInt], reachMantissa: BigInt, reachExponent: Int)

/** The shading registers in raw integers; the first `shining` lights are on. `cornerColoured` says which materials have
  * corner colours, `textured` which have a texture.
  */
final case class LightCase(
    sources:        Seq[LightSource],
    shining:        Int,
    unitShift:      Int,
    albedos:        Seq[Seq[BigInt]],
    cornerColoured: Seq[Boolean],
    textured:       Seq[Boolean],
    offset:         BigInt,
    isFlat:         Boolean,
    shadows:        Boolean
) {

  /** All lights in one position. */
  def at(position: Seq[BigInt]): LightCase = copy(sources = sources.map(_.copy(position = position)))
}

object ShaderStimulus {

  /** The words of the model's hit. */
  def words(hit: HitCase, light: LightCase): Seq[BigInt] =
    (BigInt(hit.axis) +: hit.negative.map(bit)) ++ hit.origin ++ hit.shear ++ (hit.t +: hit.weights) ++
      (bit(hit.backSide) +: hit.normals.flatten) ++ hit.geometricNormal ++
      Seq(light.offset, bit(light.isFlat), bit(light.shadows)) ++ words(light)

  def words(point: EnvironmentPointCase, light: LightCase): Seq[BigInt] =
    point.point ++ point.normal ++ Seq(light.offset, bit(light.shadows && point.shadows)) ++ words(light)

  private def words(light: LightCase): Seq[BigInt] =
    BigInt(light.shining) +: light.sources.take(light.shining).flatMap(source =>
      source.position.map(_ << light.unitShift) ++ source.colour ++
        Seq(source.reachMantissa, BigInt(source.reachExponent))
    )

  /** The words of the model's colour at a hit. */
  def colourWords(hit: HitCase): Seq[BigInt] = hit.weights ++ hit.colours.flatten

  def bit(claim: Boolean): BigInt = if (claim) 1 else 0
}

/** Random hits and lights of all sizes, with the limits of every range. */
final class ShaderStimulus(config: ColonnadeConfig, random: Random) {
  private val numbers = config.numbers

  private def chance(oneIn: Int): Boolean = random.nextInt(oneIn) == 0

  private def natural(bits: Int): BigInt =
    if (chance(8)) BigInt(0) else if (chance(8)) (BigInt(1) << bits) - 1 else BigInt(random.nextInt(bits) + 1, random)

  private def signed(bits: Int): BigInt = {
    val magnitude = natural(bits - 1)
    if (chance(16)) -(BigInt(1) << (bits - 1)) else if (random.nextBoolean()) magnitude else -magnitude
  }

  private def xyz[T](value: => T): Seq[T] = Seq.fill(3)(value)

  private def unit(vector: Seq[Double]): Seq[BigInt] = {
    val length = math.sqrt(vector.map(x => x * x).sum)
    vector.map(x => BigInt(math.round(x / length * 2047)))
  }

  private def anyUnit: Seq[BigInt] = unit(xyz(random.nextGaussian()))

  private def nearly(vector: Seq[BigInt]): Seq[BigInt] = unit(vector.map(_.toDouble + random.nextGaussian() * 300))

  def light(): LightCase = {
    val shift = random.nextInt((numbers.sceneBits - 4).min(if (random.nextBoolean()) 6 else 64))
    val bits  = numbers.macBits.min(numbers.sceneBits - shift)
    LightCase(
      sources = Seq.fill(config.frame.lights)(source(bits)),
      shining = if (chance(4)) random.nextInt(config.frame.lights + 1) else config.frame.lights,
      unitShift = shift,
      albedos = Seq.fill(config.frame.materials)(colour()),
      cornerColoured = Seq.fill(config.frame.materials)(config.geometry.cornerColours && !chance(3)),
      textured = Seq.fill(config.frame.materials)(config.geometry.texture.nonEmpty && !chance(3)),
      offset = natural(numbers.gridBits - 2),
      isFlat = chance(4),
      shadows = !chance(4)
    )
  }

  /** Lights near the object, with a falloff of about one there, in a place where all directions are alike. */
  def typicalLight(): LightCase = {
    val plain = light()
    plain.copy(
      unitShift = 0,
      sources = plain.sources.map(_.copy(
        position = xyz(anywhere()),
        colour = xyz(BigInt(random.nextInt(1 << 14))),
        reachMantissa = (BigInt(1) << (numbers.mantissaBits - 1)) + BigInt(numbers.mantissaBits - 1, random),
        reachExponent = 2 * (numbers.gridBits - 2) - numbers.mantissaBits
      ))
    )
  }

  /** A point near the object that faces any direction. */
  def typicalPoint(): EnvironmentPointCase = environmentPoint().copy(point = xyz(anywhere()), normal = anyUnit)

  private def anywhere(): BigInt =
    BigInt(numbers.gridBits.min(numbers.macBits) - 2, random) * (if (random.nextBoolean()) 1 else -1)

  private def colour(): Seq[BigInt] = xyz(natural(NumberFormats.colourBits))

  /** A light without falloff, or with a reference distance near the scene, or with any. */
  private def source(positionBits: Int): LightSource = {
    val reach =
      if (chance(3)) BigInt(0) else (BigInt(1) << (numbers.mantissaBits - 1)) + BigInt(numbers.mantissaBits - 1, random)
    val nearby  = 2 * numbers.gridBits - numbers.mantissaBits + random.nextInt(16) - 10
    val largest = 1 << (NumberFormats.bitLength(2 * numbers.sceneBits))
    LightSource(
      position = xyz(signed(positionBits)),
      colour = xyz(natural(NumberFormats.lightBits)),
      reachMantissa = reach,
      reachExponent = if (chance(6)) random.nextInt(2 * largest) - largest else nearby
    )
  }

  /** Components of any size. */
  def anyHit(): HitCase = hit(
    origin = xyz(signed(numbers.gridBits)),
    t = natural(numbers.gridBits - 1),
    normals = xyz(xyz(signed(NumberFormats.normalBits))),
    geometricNormal = xyz(signed(NumberFormats.normalBits))
  )

  /** Unit normals that face the light, or face away from it. */
  def surfaceHit(light: LightCase): HitCase = {
    val way               = light.sources.head.position.map(x => (x << light.unitShift).toDouble)
    val faceForwardNormal = if (way.forall(_ == 0)) anyUnit else unit(way.map(x => if (chance(10)) -x else x))
    val average           = if (chance(3)) anyUnit else if (chance(3)) faceForwardNormal else nearly(faceForwardNormal)
    val normals           = xyz(if (chance(5)) average else nearly(average))
    hit(
      origin = xyz(signed(numbers.gridBits - random.nextInt(8))),
      t = natural(numbers.gridBits - 4),
      normals = normals,
      geometricNormal = if (chance(3)) average else nearly(average)
    )
  }

  /** Anywhere in an environment, at most half as far as the scene's size; with any normal, or none. */
  def environmentPoint(): EnvironmentPointCase = EnvironmentPointCase(
    context = random.nextInt(config.units.pathContexts),
    point = xyz(signed(if (random.nextBoolean()) numbers.gridBits else numbers.sceneBits - 1)),
    normal = if (chance(10)) xyz(signed(NumberFormats.normalBits)) else if (chance(20)) xyz(BigInt(0)) else anyUnit,
    albedo = colour(),
    shadows = random.nextBoolean()
  )

  /** Vertex normals that cancel, or that have the weight 0. */
  def withoutSmoothNormal(): HitCase = {
    val plain = anyHit()
    if (random.nextBoolean()) plain.copy(weights = xyz(BigInt(0)))
    else {
      val normal = anyUnit
      plain.copy(
        normals = Seq(normal, normal.map(-_), anyUnit),
        weights = Seq.fill(2)(natural(numbers.barycentricBits)).map(_ => BigInt(5)) :+ BigInt(0)
      )
    }
  }

  /** Products halfway between two grid steps, or next to that: by little, or by half of what the lowest digit holds.
    * The offset's product too if it is odd.
    */
  def halfway(): HitCase = {
    val fraction       = numbers.shearFraction - numbers.shadeBits
    val isDigit        = fraction > 0 && random.nextBoolean()
    def near(): BigInt =
      if (isDigit) (((BigInt(numbers.shadeBits - 1, random) << 1) + 1) << fraction) + 1
      else (BigInt(1) << (numbers.shearFraction - 1)) + random.nextInt(3) - 1
    anyHit().copy(
      shear = Seq.fill(2)(near() * (if (random.nextBoolean()) 1 else -1)),
      t = if (isDigit) BigInt(1) << (numbers.shadeBits - 1) else random.nextInt(64),
      geometricNormal = Seq(1024, -1024, 1025)
    )
  }

  /** All normals are zero. */
  def withoutNormal(): HitCase = withoutSmoothNormal().copy(geometricNormal = xyz(BigInt(0)))

  private def hit(
      origin:          Seq[BigInt],
      t:               BigInt,
      normals:         Seq[Seq[BigInt]],
      geometricNormal: Seq[BigInt]
  ): HitCase = {
    val steepest = BigInt(1) << numbers.shearFraction
    HitCase(
      context = random.nextInt(config.units.pathContexts),
      axis = random.nextInt(3),
      negative = xyz(random.nextBoolean()),
      origin = origin,
      shear = Seq.fill(2)(if (chance(8)) steepest else natural(numbers.shearFraction)).map(s =>
        if (random.nextBoolean()) s else -s
      ),
      t = t,
      weights = xyz(natural(numbers.barycentricBits)),
      backSide = random.nextBoolean(),
      normals = normals,
      geometricNormal = geometricNormal,
      colours = if (chance(6)) { val same = colour(); xyz(same) }
      else xyz(colour()),
      material = random.nextInt(config.frame.materials)
    )
  }
}
