package colonnade.environment

import colonnade.config.{AttributeLayout, ColonnadeConfig}

/** The registers of a view. */
final case class ViewCase(
    matrix:         Seq[BigInt],
    offset:         Seq[BigInt],
    offsetShift:    Int,
    exponent:       Int,
    rotation:       Seq[BigInt],
    steps:          Seq[BigInt],
    boundingPlanes: Int,

    /** Grid steps. */
    occlusionTolerance: BigInt = 0,
    isMapCamera:        Boolean = true
) {
  def words: Seq[BigInt] =
    matrix ++ offset ++ Seq[BigInt](
      offsetShift,
      exponent
    ) ++ rotation ++ steps :+ BigInt(boundingPlanes) :+ occlusionTolerance :+ mapCamera

  def fields: Map[String, BigInt] =
    matrix.zipWithIndex.map { case (value, i) => s"matrix[${i / 3}].${"xyz" (i % 3)}" -> value }.toMap ++
      rotation.zipWithIndex.map { case (value, i) => s"rotation[${i / 3}].${"xyz" (i % 3)}" -> value } ++
      offset.zipWithIndex.map { case (value, i) => s"offset.${"xyz" (i)}" -> value } ++
      Seq("stepX", "stepY").zip(steps) ++
      Map(
        "offsetShift"        -> BigInt(offsetShift),
        "exponent"           -> BigInt(exponent),
        "boundingPlanes"     -> BigInt(boundingPlanes),
        "occlusionTolerance" -> occlusionTolerance,
        "isMapCamera"        -> mapCamera
      )

  private def mapCamera = BigInt(if (isMapCamera) 1 else 0)
}

object ViewCase {

  /** The view of a camera.
    *
    * @param focal  pixels of the map, as `middle`
    * @param axes   of view space, in the scene
    * @param camera the camera's position, in grid steps
    * @param metre  its grid steps
    */
  def of(
      config: ColonnadeConfig,
      focal:  Double,
      middle: Seq[Double],
      axes:   Seq[Seq[Double]],
      camera: Seq[BigInt],
      metre:  Double,
      steps:  Seq[BigInt]
  ): ViewCase = {
    val numbers                                   = config.numbers
    def row(a: Double, x: Seq[Double], b: Double) =
      x.zip(axes(2)).map { case (p, q) => (a * p + b * q) / (metre * EnvironmentScene.depthUnit) }
    val image    = Seq(0, 1).map(axis => row(focal / 1024, axes(axis), middle(axis) / 1024))
    val rows     = image :+ row(0, axes(0), 1)
    val largest  = rows.flatten.map(_.abs).max
    val bits     = numbers.macBits.min(50) - 2
    val exponent = bits - math.getExponent(largest) - 1
    val matrix   = rows.map(_.map(value => BigDecimal(value * math.pow(2, exponent)).toBigInt))
    val offset   = matrix.map(row => -row.zip(camera).map { case (m, c) => m * c }.sum)
    val shift    = (offset.map(_.bitLength).max - numbers.macBits + 1).max(0)
    ViewCase(
      matrix.flatten,
      offset.map(_ >> shift),
      shift,
      exponent,
      Seq.tabulate(9)(i => BigDecimal(axes(i % 3)(i / 3) * 16384).toBigInt),
      steps,
      config.physicalAttributeMemory.get.boundingPlanes.min(5)
    )
  }

  /** Pixels of the map per half pixel of the frame, in steps of the registers. */
  def stepWidths(config: ColonnadeConfig, frame: Seq[Int]): Seq[BigInt] = {
    val map = AttributeLayout.of(config).config
    Seq(map.width, map.height).zip(frame).map { case (size, pixels) =>
      (BigInt(size) << (config.numbers.shadeBits + 12 - 11)) / pixels
    }
  }
}
