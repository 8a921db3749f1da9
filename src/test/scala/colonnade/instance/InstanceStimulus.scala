package colonnade.instance

import colonnade.config.ColonnadeConfig
import colonnade.formats.ObjectInstance
import colonnade.{Model, TestConfigs}

import scala.util.Random

/** A prepared ray of the world, in its own frame, in grid steps. */
final case class WorldRay(axis: Int, negative: Seq[Int], origin: Seq[BigInt], shear: Seq[BigInt]) {

  def numbers: Seq[BigInt] = (axis +: negative).map(BigInt(_)) ++ origin ++ shear

  /** By the names of its fields in a payload. */
  def fields(of: String): Map[String, BigInt] =
    Map(s"$of.orientation.axis" -> BigInt(axis)) ++
      negative.zipWithIndex.map { case (sign, i) => s"$of.orientation.negative[$i]" -> BigInt(sign) } ++
      origin.zipWithIndex.map { case (value, i) => s"$of.origin[$i]" -> value } ++
      shear.zipWithIndex.map { case (value, i) => s"$of.shear[$i]" -> value }
}

/** The transform of an instance: the rows of its matrix, its shift, and its origin in grid steps. */
final case class Transform(matrix: Seq[Seq[BigInt]], shift: Int, origin: Seq[BigInt]) {

  def numbers: Seq[BigInt] = matrix.flatten ++ Seq(BigInt(shift)) ++ origin

  def fields(of: String): Map[String, BigInt] =
    (for ((row, i) <- matrix.zipWithIndex; (value, axis) <- row.zip("xyz"))
      yield s"$of.matrix[$i].$axis" -> value).toMap ++
      origin.zip("xyz").map { case (value, axis) => s"$of.origin.$axis" -> value } + (s"$of.shift" -> BigInt(shift))
}

/** A ray in an instance: hits before `tMax` count in the world; one is `beyond` the ray's entry in the object. */
final case class InstanceCase(ray: WorldRay, tMax: BigInt, transform: Transform, beyond: BigInt)

/** The model's ray in the object, and if it enters the object's cube, its entry and the world's t of the hit. */
final case class ObjectCase(
    origin:   Seq[BigInt],
    dir:      Seq[BigInt],
    limit:    BigInt,
    mantissa: BigInt,
    exponent: BigInt,
    entry:    Option[(BigInt, BigInt)]
)

/** Random rays and instances: those of any numbers, and rays that meet the cube of an object. */
final class InstanceStimulus(config: ColonnadeConfig, random: Random) {
  private val numbers = config.numbers
  private val grid    = numbers.gridBits
  private val cube    = BigInt(1) << (numbers.vertexBits + numbers.gridFraction)
  private val one     = BigInt(1) << numbers.shearFraction
  private val largest = BigInt(1) << (ObjectInstance.matrixBits - 2)

  def ray(): WorldRay = WorldRay(
    random.nextInt(3),
    Seq.fill(3)(random.nextInt(2)),
    Seq.fill(3)(if (random.nextInt(4) == 0) signed(grid) else below(cube)),
    Seq.fill(2)(if (random.nextInt(5) == 0) one * (random.nextInt(3) - 1) else below(2 * one + 1) - one)
  )

  /** A box in cells, low and high: any one, in a quarter of cases a flat one. */
  def box(): (Seq[BigInt], Seq[BigInt]) = {
    val (some, other) = (Seq.fill(3)(BigInt(7, random)), Seq.fill(3)(BigInt(7, random)))
    val low           = some.zip(other).map { case (a, b) => a.min(b) }
    (low, if (random.nextInt(4) == 0) low else some.zip(other).map { case (a, b) => a.max(b) })
  }

  /** Of a number of bits, from few to all. */
  def distance(): BigInt = BigInt(random.nextInt(grid), random)

  def rayInside(): WorldRay = ray().copy(origin = Seq.fill(3)(below(cube)))

  val farthest: BigInt = (BigInt(1) << (grid - 1)) - 1

  /** Any numbers: from mirrors to shears, near to and far from the ray. */
  def transform(): Transform =
    Transform(
      Seq.fill(3)(Seq.fill(3)(signed(ObjectInstance.matrixBits))),
      1 + random.nextInt(63),
      Seq.fill(3)(signed(grid))
    )

  /** Axes that are permuted, mirrored and stretched, so that the ray leads through a point of the cube. */
  def through(ray: WorldRay): Transform = {
    val way      = ray.shear :+ (if (ray.negative(2) == 1) -one else one)
    val length   = below(cube)
    val onRay    = ray.origin.zip(way).map { case (from, slope) => from + slope * length / one }
    val inWorld  = Seq.tabulate(3)(axis => onRay((axis + 2 - ray.axis) % 3))
    val axes     = random.shuffle(Seq(0, 1, 2))
    val scales   = Seq.fill(3)((largest + below(largest)) * (2 * random.nextInt(2) - 1))
    val inObject = Seq.fill(3)(below(cube))
    val matrix   = Seq.tabulate(3, 3)((row, column) => if (axes(row) == column) scales(row) else BigInt(0))
    val origin   = Seq.tabulate(3) { axis =>
      val row = axes.indexOf(axis)
      inWorld(axis) - inObject(row) * largest / scales(row)
    }
    val space = BigInt(1) << (grid - 1)
    if (origin.forall(value => value >= -space && value < space))
      Transform(matrix, ObjectInstance.matrixBits - 2, origin)
    else through(ray)
  }

  /** The rays with an instance that they meet, or any one. */
  def cases(count: Int): Seq[InstanceCase] = Seq.fill(count) {
    val from = ray()
    val to   = if (random.nextInt(3) == 0) transform() else through(from)
    InstanceCase(from, distance(), to, distance())
  }

  def answers(cases: Seq[InstanceCase]): Seq[ObjectCase] = {
    val requests = cases.map(each => (each.ray.numbers :+ each.tMax) ++ each.transform.numbers :+ each.beyond)
    Model.answers(config, requests, "instanceray").map { reply =>
      val Seq(limit, mantissa, exponent, enters) = reply.slice(6, 10)
      val entry                                  = Option.when(enters == 1)((reply(10), reply(11)))
      ObjectCase(reply.take(3), reply.slice(3, 6), limit, mantissa, exponent, entry)
    }
  }

  private def below(limit: BigInt): BigInt = BigInt(limit.bitLength + 8, random) % limit

  private def signed(bits: Int): BigInt = BigInt(bits, random) - (BigInt(1) << (bits - 1))
}

object InstanceStimulus {

  /** The box of an object that fills the world. */
  val wholeCube: (Seq[BigInt], Seq[BigInt]) = (Seq.fill(3)(BigInt(0)), Seq.fill(3)(BigInt(127)))

  /** The presets' formats, the narrowest and the widest, with instances. */
  val formats: Seq[ColonnadeConfig] =
    Seq(
      TestConfigs.tiny,
      TestConfigs.withPrecision(16, 16, 32),
      TestConfigs.withPrecision(64, 64, 64)
    ).map(TestConfigs.withInstances(_, 3))
}
