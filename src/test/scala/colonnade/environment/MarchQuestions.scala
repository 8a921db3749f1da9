package colonnade.environment

import chisel3.Data
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.RoomView

import scala.util.Random

/** A ray: grid steps, and a direction of any length; from the camera, if it is seen in a pixel. */
final case class MarchQuestion(
    context: Int,
    origin:  Seq[BigInt],
    towards: Seq[BigInt],
    pixel:   Seq[BigInt] = Seq(0, 0),
    isSeen:  Boolean = false
) {
  def words: Seq[BigInt] = (BigInt(if (isSeen) 1 else 0) +: pixel) ++ origin ++ towards

  def fields: Map[String, BigInt] = {
    val axes = Seq("x", "y", "z")
    axes.zip(origin).map { case (axis, value) => s"ray.origin.$axis" -> value }.toMap ++
      axes.zip(towards).map { case (axis, value) => s"ray.towards.$axis" -> value } ++
      axes.zip(pixel).map { case (axis, value) => s"ray.pixel.$axis" -> value } +
      ("context" -> BigInt(context)) + ("isSeen" -> BigInt(if (isSeen) 1 else 0))
  }
}

object MarchQuestion {

  /** What the model's answer says, in its order. */
  val answer: Seq[String] = Seq("kind", "x", "y", "entry", "isHidden", "travel", "travelExponent", "steps") ++
    Seq("x", "y", "z").map(axis => s"point.$axis") ++ Seq("r", "g", "b").map(channel => s"albedo.$channel") ++
    Seq("x", "y", "z").map(axis => s"normal.$axis") :+ "isIllegal"
}

/** Views of a room, and rays in it. */
final class MarchQuestions(config: ColonnadeConfig, random: Random) {
  private val numbers = config.numbers
  private val shells  = config.physicalAttributeMemory.get.shellPlanes
  private val layout  = AttributeLayout.of(config)

  /** Steps in a metre. */
  private val metre = math.pow(2, numbers.sceneBits - 7.0)

  /** A frame's size, not the map's. */
  private val frame = Seq(97, 61).map(_.min(config.frame.maxWidth).min(config.frame.maxHeight))

  /** A camera somewhere, turned somehow; metres. */
  final class Camera(val focal: Double, val middle: Seq[Double], isTurned: Boolean) {
    private val turn = if (isTurned) random.nextDouble() * 6.3 else 0.0
    val place: Seq[Double] = if (isTurned) Seq.fill(3)(random.nextDouble() * 4 - 2) else Seq(0.0, 0.0, 0.0)

    /** A point of view space in the scene. */
    def turned(p: Seq[Double]): Seq[Double] =
      Seq(math.cos(turn) * p(0) + math.sin(turn) * p(2), p(1), -math.sin(turn) * p(0) + math.cos(turn) * p(2))

    def steps(p: Seq[Double]): Seq[BigInt] =
      turned(p).zip(place).map { case (a, b) => BigDecimal((a + b) * metre).toBigInt }

    val view: ViewQuestion = {
      val axes = Seq(Seq(1.0, 0, 0), Seq(0, 1.0, 0), Seq(0, 0, 1.0)).map(turned)
      ViewQuestion.of(config, focal, middle, axes, steps(Seq(0, 0, 0)), metre, stepWidths(random.nextInt(2)))
    }
  }

  /** From a point of view space along a direction. */
  def ray(camera: Camera, from: Seq[Double], towards: Seq[Double]): MarchQuestion = {
    val length = towards.map(_.abs).max
    val scale  = math.pow(2, numbers.shadeBits.toDouble) - 1
    val turned = camera.turned(towards.map(_ / (1.5 * length)))
    MarchQuestion(context(), camera.steps(from), turned.map(t => BigDecimal(t * scale).toBigInt))
  }

  private def spread(size: Double): Double = (random.nextDouble() * 2 - 1) * size

  /** To the back wall where the box hides it. */
  def behindBox(camera: Camera): MarchQuestion =
    ray(camera, Seq(spread(0.3), 0.1, 3 + spread(0.2)), Seq(spread(0.1), 0.7 + spread(0.1), 1.0))

  /** Within the room, on its surfaces, just behind them, beyond the view, behind the camera; in any direction, along an
    * axis, to the camera or away from it.
    */
  def inRoom(camera: Camera): MarchQuestion = {
    val from = random.nextInt(8) match {
      case 0 => Seq(spread(1.9), 1.2 + spread(0.02), 0.5 + random.nextDouble() * 3)
      case 1 => Seq(spread(0.5), 0.4 + spread(0.02), 2.1 + random.nextDouble() * 0.5)
      case 2 => Seq(spread(2), spread(1), -random.nextDouble())
      case 3 => Seq(0.0, 0.0, 0.3 + random.nextDouble() * 4)
      case 4 => Seq(spread(3), spread(3), random.nextDouble() * 5)
      case _ => Seq(spread(1), spread(0.6), 1 + random.nextDouble() * 2.8)
    }
    val towards = random.nextInt(6) match {
      case 0 => from.map(-_)
      case 1 => from
      case 2 => Seq.tabulate(3)(i => if (i == random.nextInt(3)) 1.0 else 0.0).updated(2, spread(1))
      case 3 => Seq(0.0, 0.0, 1.0).map(_ * (if (random.nextBoolean()) 1 else -1))
      case _ => Seq.fill(3)(spread(1))
    }
    ray(camera, from, if (towards.forall(_ == 0)) Seq(1.0, 0, 0) else towards)
  }

  /** Any registers that the model's widest number has room for. */
  def anyView(): ViewQuestion = {
    val bits   = numbers.macBits.min(45)
    val most   = numbers.sceneBits.min(60)
    val shift  = if (random.nextBoolean()) most else random.nextInt(most)
    val length = bits + most
    ViewQuestion(
      Seq.fill(9)(signed(bits)),
      Seq.fill(3)(signed((length - shift).min(numbers.macBits) - 1)),
      shift,
      (length - random.nextInt(12)).min(500),
      Seq.fill(9)(signed(16)),
      stepWidths(0),
      random.nextInt(shells + 1)
    )
  }

  /** Any bits in all registers. */
  def wildView(): ViewQuestion = {
    val view                         = new RoomView(numbers)
    def natural(field: Data): Int    = BigInt(field.getWidth, random).toInt
    def number(bits:   Int): BigInt  = BigInt(bits, random) - (BigInt(1) << (bits - 1))
    def steps(field:   Data): BigInt = BigInt(random.nextInt(field.getWidth + 1), random)
    ViewQuestion(
      Seq.fill(9)(number(numbers.macBits)),
      Seq.fill(3)(number(numbers.macBits)),
      natural(view.offsetShift),
      number(view.exponent.getWidth).toInt,
      Seq.fill(9)(number(RoomView.rotationBits)),
      Seq(steps(view.stepX), steps(view.stepY)),
      natural(view.shellPlanes)
    )
  }

  /** Any pixel that a frame could have, or more. */
  def wildPixel(): MarchQuestion =
    anyRay().copy(pixel = Seq.fill(2)(BigInt(numbers.coordinateBits, random)), isSeen = true)

  def anyRay(): MarchQuestion = {
    val directionBits = if (random.nextBoolean()) numbers.shadeBits + 1 else numbers.directionBits
    MarchQuestion(context(), Seq.fill(3)(signed(numbers.sceneBits.min(60))), Seq.fill(3)(signed(directionBits)))
  }

  /** That of a pixel of the frame, of any length. */
  def fromCamera(camera: Camera): MarchQuestion = {
    val pixel   = frame.map(random.nextInt(_))
    val size    = Seq(layout.config.width, layout.config.height)
    val towards = pixel.zip(frame).zip(size).zip(camera.middle).map { case (((p, f), s), m) =>
      ((p + 0.5) * s / f - m) / camera.focal
    }
    val scaled = ray(camera, Seq(0.0, 0.0, 0.0), towards :+ 1.0)
    val shift  = random.nextInt(numbers.directionBits - numbers.shadeBits)
    scaled.copy(towards = scaled.towards.map(_ << shift), pixel = pixel.map(BigInt(_)), isSeen = true)
  }

  /** Along any direction, forth and back. */
  def anyPixel(): MarchQuestion =
    anyRay().copy(pixel = frame.map(BigInt(_)).map(BigInt(8, random).min(_)), isSeen = true)

  /** Pixels of the map in one of the frame, doubled, in steps of the registers. */
  private def stepWidths(less: Int): Seq[BigInt] = ViewQuestion.stepWidths(config, frame).map(_ - less)

  private def context(): Int = random.nextInt(config.array.contexts)

  /** Small ones too, and powers of two. */
  private def signed(bits: Int): BigInt = {
    val size = if (random.nextInt(4) == 0) random.nextInt(bits - 1) + 1 else bits - 1
    val most = (BigInt(1) << size) - 1
    val some = if (random.nextInt(8) == 0) BigInt(1) << random.nextInt(size) else BigInt(size, random)
    if (random.nextBoolean()) some.min(most) else -some
  }
}
