package colonnade.config

/** Every derived width and constant of the datapaths, by the rules of docs/numbers.md.
  *
  * The manifest contains [[entries]]; model, packer and harness read them and derive nothing themselves.
  */
final case class NumberFormats(
    geometry:  GeometryConfig,
    precision: PrecisionConfig,
    frame:     FrameConfig,
    queries:   Option[QueriesConfig]
) {
  import NumberFormats._

  val vertexBits: Int = geometry.vertexBits
  val boxBits:    Int = geometry.boxBits
  val macBits:    Int = precision.mac

  /** A position or distance near the object: signed, [[gridFraction]] fraction bits (negative when narrow). */
  val gridBits:     Int = geometry.triangleBits.getOrElse(precision.mac)
  val gridFraction: Int = gridBits - vertexBits - 3

  /** A position anywhere in the scene: signed, same step as the grid. */
  val sceneBits:      Int = gridBits + reachBits
  val coordinateBits: Int = bitLength(frame.maxWidth.max(frame.maxHeight))
  val directionBits:  Int = (macBits + coordinateBits + 2).max(sceneBits + 1)
  val mantissaBits:   Int = precision.div / 2

  /** The largest left shift of a position that is not out of the scene at once. */
  val maxUnitShift: Int = (sceneBits - macBits).max(0)

  val shearFraction:      Int = gridBits - 2
  val shearDigits:        Int = shearFraction.min(mantissaBits)
  val reciprocalFraction: Int = vertexBits + 2
  val reciprocalDigits:   Int = reciprocalFraction.min(mantissaBits)
  val entrySlackShift:    Int = (reciprocalDigits - 3).max(1)
  val entryBits:          Int = vertexBits + reachBits + 3

  val weightBits:      Int = mantissaBits.min(gridBits - 1)
  val distanceDigits:  Int = gridBits.min(mantissaBits)
  val barycentricBits: Int = if (queries.nonEmpty) weightBits else weightBits.min(colourBits)

  /** Magnitude bits of a vector component in the shader's dot products: 18 suffice for a cosine of `colourBits`. */
  val shadeBits:      Int = macBits.min(colourBits + 6)
  val radicandBits:   Int = precision.sqrt / 2 * 2
  val cosineFraction: Int = mantissaBits.min(colourBits + 4)

  /** Width of the squared cosine of a refraction, unsigned: at most the width of the shader's multiplier. */
  val rootBits: Int = (2 * shadeBits + 1).min(gridBits.max(shadeBits + 1).max(lightBits + 2) - 1)

  /** Largest exponent of a node: a child's planes are less than two cubes from its node's corner. */
  val maxExponent: Int = (vertexBits - boxBits + 1).max(1)

  /** The box test's reciprocal: fraction bits of its mantissa, enough for a quarter of a child's plane. */
  val stepFraction: Int = (boxBits + 2).min(reciprocalFraction)

  /** Its steps are no finer than 2^-stepReach planes of the node along the dominant axis. */
  val stepReach: Int = boxBits + 2

  /** Distances relative to a node, in its planes along the dominant axis: signed, with this fraction. */
  val nearFraction: Int = 3

  /** Signed distances of the box test, in units. */
  val boxDistanceBits: Int = vertexBits + 3

  /** Log2 of the padding of a box in units: the sum of all rounding errors between a box and its triangles. */
  val boxPadLog: Int = {
    val reach = 1.5 * power(vertexBits)
    val step  = power(-gridFraction)
    val sum   =
      step * (if (gridFraction < 0) 2.0 else 0.5) +
        power(vertexBits + 4 - weightBits) +
        reach * (power(-shearDigits) + power(1 - mantissaBits)) +
        reach * (power(1 - reciprocalDigits) + power(2 - mantissaBits)) +
        reach * power(-reciprocalFraction) +
        (if (gridFraction > 0) 0.5 else 0.0) +
        step + power(vertexBits + 1) * (power(1 - distanceDigits) + power(2 - mantissaBits))
    math.ceil(math.log(sum) / math.log(2)).toInt.max(1)
  }

  /** The last plane of a node, padded. */
  private val farthestPlane = (((1L << boxBits) - 1) << nearFraction) + (1L << (boxPadLog + nearFraction))

  /** Width of a distance relative to a node: beyond its last plane there is at least one value to saturate to. */
  val nearBits: Int = bitLength(farthestPlane) + 1

  /** Width of a node's distance in steps: where it saturates, all children are before the node or beyond it. */
  val nodeBits: Int = {
    val steps = 1L << (stepFraction + 1)
    bitLength((farthestPlane << (stepReach - nearFraction)) + (steps << boxBits) + (steps << boxPadLog) + 4) + 1
  }

  /** The values that scene images and frame registers depend on, by their manifest key. */
  def ofImages: Seq[(String, Int)] = Seq(
    "vertexBits"     -> vertexBits,
    "boxBits"        -> boxBits,
    "macBits"        -> macBits,
    "gridBits"       -> gridBits,
    "gridFraction"   -> gridFraction,
    "sceneBits"      -> sceneBits,
    "coordinateBits" -> coordinateBits,
    "mantissaBits"   -> mantissaBits,
    "weightBits"     -> weightBits,
    "distanceDigits" -> distanceDigits,
    "shadeBits"      -> shadeBits,
    "maxExponent"    -> maxExponent,
    "boxPadLog"      -> boxPadLog,
    "normalBits"     -> normalBits,
    "normalFraction" -> normalFraction,
    "colourBits"     -> colourBits,
    "lightBits"      -> lightBits,
    "lightFraction"  -> lightFraction,
    "etaFraction"    -> etaFraction
  )

  /** All values by their manifest key. */
  def entries: Seq[(String, Int)] = ofImages ++ Seq(
    "directionBits"      -> directionBits,
    "shearFraction"      -> shearFraction,
    "shearDigits"        -> shearDigits,
    "reciprocalFraction" -> reciprocalFraction,
    "reciprocalDigits"   -> reciprocalDigits,
    "entrySlackShift"    -> entrySlackShift,
    "entryBits"          -> entryBits,
    "barycentricBits"    -> barycentricBits,
    "radicandBits"       -> radicandBits,
    "cosineFraction"     -> cosineFraction,
    "boxDistanceBits"    -> boxDistanceBits,
    "stepFraction"       -> stepFraction,
    "stepReach"          -> stepReach,
    "nearFraction"       -> nearFraction,
    "nearBits"           -> nearBits,
    "nodeBits"           -> nodeBits,
    "rootBits"           -> rootBits
  )
}

object NumberFormats {
  val reachBits: Int = 8 // the scene reaches this many doublings beyond the object's cube

  /** A stored normal component: signed, [[normalFraction]] fraction bits; the length of a unit normal. */
  val normalBits:     Int = 12
  val normalFraction: Int = 11
  val unitNormal:     Int = (1 << normalFraction) - 1

  val colourBits:    Int = 12 // a linear colour channel, unsigned; all ones is 1.0
  val lightBits:     Int = 16 // a light's intensity per channel, unsigned
  val lightFraction: Int = 12

  /** A relative refractive index, or its reciprocal, unsigned: below 8, and so is its square up to 2.8. */
  val etaBits:     Int = 16
  val etaFraction: Int = 13

  def bitLength(value: Int): Int = bitLength(value.toLong)

  def bitLength(value: Long): Int = 64 - java.lang.Long.numberOfLeadingZeros(value)

  private def power(exponent: Int): Double = math.pow(2, exponent)
}
