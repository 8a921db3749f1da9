package colonnade.environment

import chisel3.Data
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.EnvironmentView

import scala.util.Random

/** A ray in grid steps, with a direction of any length. A direct view comes from the camera through `pixel`. The object
  * is `hitDistance` away.
  */
final case class MarchCase(
    context:      Int,
    origin:       Seq[BigInt],
    dir:          Seq[BigInt],
    pixel:        Seq[BigInt] = Seq(0, 0),
    isDirectView: Boolean = false,
    hitDistance:  BigInt = 0
) {
  def words: Seq[BigInt] = (BigInt(if (isDirectView) 1 else 0) +: pixel :+ hitDistance) ++ origin ++ dir

  /** As the march has it: the direction is scaled to so many bits. */
  def fields(shadeBits: Int): Map[String, BigInt] = {
    val axes = Seq("x", "y", "z")
    axes.zip(origin).map { case (axis, value) => s"ray.origin.$axis" -> value }.toMap ++
      axes.zip(MarchCase.scaled(dir, shadeBits)).map { case (axis, value) => s"ray.dir.$axis" -> value } ++
      axes.zip(pixel).map { case (axis, value) => s"ray.pixel.$axis" -> value } +
      ("context"     -> BigInt(context)) + ("isDirectView" -> BigInt(if (isDirectView) 1 else 0)) +
      ("hitDistance" -> hitDistance)
  }
}

object MarchCase {

  /** Numbers shifted together until the largest has so many bits, and floored. */
  def scaled(numbers: Seq[BigInt], bits: Int): Seq[BigInt] = {
    val drop = numbers.map(_.bitLength).max - bits
    numbers.map(number => if (drop < 0) number << -drop else number >> drop)
  }

  /** Fields of the model's answer, in order. */
  val answer: Seq[String] =
    Seq("kind", "x", "y", "boundingPlane", "isHidden", "distance", "distanceExponent", "steps") ++
      Seq("x", "y", "z").map(axis => s"point.$axis") ++ Seq("r", "g", "b").map(channel => s"albedo.$channel") ++
      Seq("x", "y", "z").map(axis => s"normal.$axis") :+ "hidesObject" :+ "isIllegal"
}

/** Views of an environment, and rays in it. */
final class MarchStimulus(config: ColonnadeConfig, random: Random) {
  private val numbers = config.numbers
  private val shells  = config.physicalAttributeMemory.get.boundingPlanes
  private val layout  = AttributeLayout.of(config)

  /** Steps in a metre. */
  private val metre = math.pow(2, numbers.sceneBits - 7.0)

  /** The frame's size; it differs from the map's. */
  private val frame = Seq(97, 61).map(_.min(config.frame.maxWidth).min(config.frame.maxHeight))

  /** A camera at a random position with a random rotation; metres. */
  final class Camera(val focal: Double, val middle: Seq[Double], isTurned: Boolean) {
    private val angle = if (isTurned) random.nextDouble() * 6.3 else 0.0
    val position: Seq[Double] = if (isTurned) Seq.fill(3)(random.nextDouble() * 4 - 2) else Seq(0.0, 0.0, 0.0)

    /** A vector of view space in the scene's axes. */
    def rotate(p: Seq[Double]): Seq[Double] =
      Seq(math.cos(angle) * p(0) + math.sin(angle) * p(2), p(1), -math.sin(angle) * p(0) + math.cos(angle) * p(2))

    def steps(p: Seq[Double]): Seq[BigInt] =
      rotate(p).zip(position).map { case (a, b) => BigDecimal((a + b) * metre).toBigInt }

    val view: ViewCase = {
      val axes = Seq(Seq(1.0, 0, 0), Seq(0, 1.0, 0), Seq(0, 0, 1.0)).map(rotate)
      ViewCase
        .of(config, focal, middle, axes, steps(Seq(0, 0, 0)), metre, stepWidths(random.nextInt(2)))
        .copy(occlusionTolerance =
          if (random.nextInt(4) == 0) 0 else BigDecimal(random.nextDouble() * metre / 9).toBigInt
        )
    }
  }

  /** From a point of view space along a direction. */
  def ray(camera: Camera, from: Seq[Double], dir: Seq[Double]): MarchCase = {
    val length   = dir.map(_.abs).max
    val scale    = math.pow(2, numbers.shadeBits.toDouble) - 1
    val rotated  = camera.rotate(dir.map(_ / (1.5 * length)))
    val distance = BigDecimal(random.nextDouble() * 4 * metre).toBigInt
    MarchCase(context(), camera.steps(from), rotated.map(t => BigDecimal(t * scale).toBigInt), hitDistance = distance)
  }

  private def spread(size: Double): Double = (random.nextDouble() * 2 - 1) * size

  /** To the part of the back wall that the box hides. */
  def behindBox(camera: Camera): MarchCase =
    ray(camera, Seq(spread(0.3), 0.1, 3 + spread(0.2)), Seq(spread(0.1), 0.7 + spread(0.1), 1.0))

  /** Origins within the environment, on its surfaces, just behind them, outside the view and behind the camera.
    * Directions at random, along an axis, to the camera and away from it.
    */
  def inRoom(camera: Camera): MarchCase = {
    val from = random.nextInt(8) match {
      case 0 => Seq(spread(1.9), 1.2 + spread(0.02), 0.5 + random.nextDouble() * 3)
      case 1 => Seq(spread(0.5), 0.4 + spread(0.02), 2.1 + random.nextDouble() * 0.5)
      case 2 => Seq(spread(2), spread(1), -random.nextDouble())
      case 3 => Seq(0.0, 0.0, 0.3 + random.nextDouble() * 4)
      case 4 => Seq(spread(3), spread(3), random.nextDouble() * 5)
      case _ => Seq(spread(1), spread(0.6), 1 + random.nextDouble() * 2.8)
    }
    val dir = random.nextInt(6) match {
      case 0 => from.map(-_)
      case 1 => from
      case 2 => Seq.tabulate(3)(i => if (i == random.nextInt(3)) 1.0 else 0.0).updated(2, spread(1))
      case 3 => Seq(0.0, 0.0, 1.0).map(_ * (if (random.nextBoolean()) 1 else -1))
      case _ => Seq.fill(3)(spread(1))
    }
    ray(camera, from, if (dir.forall(_ == 0)) Seq(1.0, 0, 0) else dir)
  }

  /** Random registers that fit the model's widest number. */
  def anyView(): ViewCase = {
    val bits   = numbers.macBits.min(45)
    val most   = numbers.sceneBits.min(60)
    val shift  = if (random.nextBoolean()) most else random.nextInt(most)
    val length = bits + most
    ViewCase(
      Seq.fill(9)(signed(bits)),
      Seq.fill(3)(signed((length - shift).min(numbers.macBits) - 1)),
      shift,
      (length - random.nextInt(12)).min(500),
      Seq.fill(9)(signed(16)),
      stepWidths(0),
      random.nextInt(shells + 1),
      BigInt(numbers.gridBits - 2, random)
    )
  }

  /** Random bits in all registers. */
  def wildView(): ViewCase = {
    val view                         = new EnvironmentView(numbers)
    def natural(field: Data): Int    = BigInt(field.getWidth, random).toInt
    def number(bits:   Int): BigInt  = BigInt(bits, random) - (BigInt(1) << (bits - 1))
    def steps(field:   Data): BigInt = BigInt(random.nextInt(field.getWidth + 1), random)
    ViewCase(
      Seq.fill(9)(number(numbers.macBits)),
      Seq.fill(3)(number(numbers.macBits)),
      natural(view.offsetShift),
      number(view.exponent.getWidth).toInt,
      Seq.fill(9)(number(EnvironmentView.rotationBits)),
      Seq(steps(view.stepX), steps(view.stepY)),
      natural(view.boundingPlanes),
      steps(view.occlusionTolerance)
    )
  }

  /** Any pixel, inside the frame or outside. */
  def wildPixel(): MarchCase =
    anyRay().copy(pixel = Seq.fill(2)(BigInt(numbers.coordinateBits, random)), isDirectView = true)

  def anyRay(): MarchCase = {
    val directionBits = if (random.nextBoolean()) numbers.shadeBits + 1 else numbers.directionBits
    MarchCase(
      context(),
      Seq.fill(3)(signed(numbers.sceneBits.min(60))),
      Seq.fill(3)(signed(directionBits)),
      hitDistance = BigInt(random.nextInt(numbers.sceneBits + 2), random)
    )
  }

  /** The ray of a pixel of the frame, with a direction of any length. */
  def fromCamera(camera: Camera): MarchCase = {
    val pixel = frame.map(random.nextInt(_))
    val size  = Seq(layout.config.width, layout.config.height)
    val dir   = pixel.zip(frame).zip(size).zip(camera.middle).map { case (((p, f), s), m) =>
      ((p + 0.5) * s / f - m) / camera.focal
    }
    val scaled = ray(camera, Seq(0.0, 0.0, 0.0), dir :+ 1.0)
    val shift  = random.nextInt(numbers.directionBits - numbers.shadeBits)
    scaled.copy(dir = scaled.dir.map(_ << shift), pixel = pixel.map(BigInt(_)), isDirectView = true)
  }

  /** A ray of a camera that is not the maps': near that one, at it, on its near plane, beside what it sees, behind it.
    * Directions to a point of the room, along an axis, at random.
    */
  def fromElsewhere(camera: Camera): MarchCase = {
    val from = random.nextInt(8) match {
      case 0 => Seq(0.0, 0.0, 0.0)
      case 1 => Seq(spread(0.3), spread(0.3), EnvironmentScene.depthUnit)
      case 2 => Seq(spread(3), spread(3), random.nextDouble() * 4)
      case 3 => Seq(spread(0.5), spread(0.5), -random.nextDouble() * 2)
      case 4 => Seq(0.0, spread(0.01), spread(0.01))
      case _ => Seq.fill(3)(spread(0.4))
    }
    val target = Seq(spread(1.8), spread(1.1), 1 + random.nextDouble() * 3)
    val dir    = random.nextInt(8) match {
      case 0 => Seq.fill(3)(spread(1))
      case 1 => Seq.tabulate(3)(i => if (i == random.nextInt(3)) 1.0 else 0.0).updated(2, spread(1))
      case _ => target.zip(from).map { case (t, f) => t - f }
    }
    ray(camera, from, if (dir.forall(_ == 0)) Seq(0.0, 0, 1) else dir).copy(isDirectView = true)
  }

  /** A pixel's ray with a random direction. */
  def anyPixel(): MarchCase =
    anyRay().copy(pixel = frame.map(BigInt(_)).map(BigInt(8, random).min(_)), isDirectView = true)

  /** See [[ViewCase.stepWidths]]. */
  private def stepWidths(less: Int): Seq[BigInt] = ViewCase.stepWidths(config, frame).map(_ - less)

  private def context(): Int = random.nextInt(config.units.pathContexts)

  /** Numbers of all sizes, and powers of two. */
  private def signed(bits: Int): BigInt = {
    val size = if (random.nextInt(4) == 0) random.nextInt(bits - 1) + 1 else bits - 1
    val most = (BigInt(1) << size) - 1
    val some = if (random.nextInt(8) == 0) BigInt(1) << random.nextInt(size) else BigInt(size, random)
    if (random.nextBoolean()) some.min(most) else -some
  }
}
