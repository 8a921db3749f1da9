package colonnade.traversal

import scala.util.Random

import colonnade.Model
import colonnade.config.ColonnadeConfig

/** A ray for the triangle test: raw integers in its own frame. */
final case class TestRay(axis: Int, negative: Seq[Boolean], origin: Seq[BigInt], shear: Seq[BigInt])

/** A triangle by its vertices in object space. */
final case class TestTriangle(vertices: Seq[Seq[BigInt]])

/** The expected result of one triangle. */
final case class ExpectedHit(isHit: Boolean, t: BigInt, weights: Seq[BigInt], backSide: Boolean)

/** Random and directed rays and triangles of a configuration, and the model's results. */
final class TriangleStimulus(config: ColonnadeConfig, seed: Int) {
  private val numbers = config.numbers
  private val random  = new Random(seed)
  private val cube    = BigInt(1) << numbers.vertexBits
  private val reach   = steps(cube / 2)

  /** Units as grid steps. */
  private def steps(units: BigInt): BigInt =
    if (numbers.gridFraction >= 0) units << numbers.gridFraction else units >> -numbers.gridFraction

  def below(limit: BigInt): BigInt = BigInt(limit.bitLength + 32, random).mod(limit)

  def between(low: BigInt, high: BigInt): BigInt = low + below(high - low + 1)

  private def one: BigInt = BigInt(1) << numbers.shearFraction

  def chance(times: Int): Boolean = random.nextInt(times) == 0

  def nextInt(limit: Int): Int = random.nextInt(limit)

  def shear: BigInt = random.nextInt(6) match {
    case 0 => 0
    case 1 => if (random.nextBoolean()) one else -one
    case 2 => between(-3, 3)
    case _ => between(-one, one)
  }

  def origin: BigInt = random.nextInt(8) match {
    case 0 => -reach
    case 1 => 3 * reach
    case 2 => steps(below(cube))
    case _ => between(-reach, 3 * reach)
  }

  def ray: TestRay = {
    val shears = Seq.fill(2)(shear)
    // A sign equals that of the shear; it is free if the shear is 0.
    val signs = shears.map(s => if (s == 0) random.nextBoolean() else s < 0)
    TestRay(random.nextInt(3), signs :+ random.nextBoolean(), Seq.fill(3)(origin), shears)
  }

  def coordinate: BigInt = random.nextInt(10) match {
    case 0 => 0
    case 1 => cube - 1
    case _ => below(cube)
  }

  def vertex: Seq[BigInt] = Seq.fill(3)(coordinate)

  /** Any triangle, or one around a point: small, large, with an edge or vertex there, or with a right angle and legs
    * that are powers of two, so that its weights add up to a little less than one as a ray along an axis sees it.
    */
  def triangle(point: Seq[BigInt]): TestTriangle = random.nextInt(10) match {
    case 0 => TestTriangle(Seq.fill(3)(vertex))
    case 1 => TestTriangle(Seq.fill(3)(Seq.fill(3)(if (random.nextBoolean()) BigInt(0) else cube - 1)))
    case 2 => val other = vertex; TestTriangle(Seq(other, other, vertex))
    case 3 => TestTriangle(random.shuffle(Seq(point, vertex, vertex)))
    case 4 =>
      val axis   = random.nextInt(3)
      val legs   = Seq(1, 2).map(offset => (axis + offset) % 3 -> (cube >> (1 + random.nextInt(3))))
      val corner = legs.foldLeft(point) { case (at, (side, leg)) =>
        at.updated(side, (at(side) - below(leg / 2)).max(0).min(cube - 1 - leg))
      }
      TestTriangle(random.shuffle(corner +: legs.map { case (side, leg) => corner.updated(side, corner(side) + leg) }))
    case _ =>
      val size     = BigInt(1) << (2 + random.nextInt(numbers.vertexBits - 1))
      val near     = Seq.fill(2)(point.map(c => inCube(c + between(-size, size))))
      val opposite = Seq(0, 1, 2).map(a => inCube(3 * point(a) - near(0)(a) - near(1)(a)))
      TestTriangle(random.shuffle(near :+ opposite))
  }

  /** Two triangles with a common edge, most of them around a point; a few with an edge that is a point, or equal ones.
    */
  def pair(point: Seq[BigInt]): Seq[TestTriangle] = {
    val Seq(a, b, c) = triangle(point).vertices
    val d            = if (chance(2)) vertex else triangle(point).vertices.head
    random.nextInt(14) match {
      case 0 => pairOf(a, b, c, c)
      case 1 => pairOf(a, a, c, d)
      case _ => pairOf(a, b, c, d)
    }
  }

  private def pairOf(a: Seq[BigInt], b: Seq[BigInt], c: Seq[BigInt], d: Seq[BigInt]): Seq[TestTriangle] =
    Seq(TestTriangle(Seq(a, b, c)), TestTriangle(Seq(b, a, d)))

  /** A ray, three in four times aimed at a point or next to it, with triangles, most of them around that point. */
  def meeting(triangles: Int): (TestRay, Seq[TestTriangle]) = {
    val point = vertex
    val met   = if (triangles == 2) pair(point) else Seq.fill(triangles)(triangle(point))
    val next  = if (chance(2)) steps(1) else BigInt(0)
    (if (chance(4)) ray else rayTo(point.map(steps(_) + between(0, next))), met)
  }

  /** Triangles that surround a vertex as a ray sees it, and the ray, aimed at it or at an edge that meets it. */
  def fan: (TestRay, Seq[TestTriangle]) = {
    val corners = 5 + random.nextInt(4)
    val axis    = random.nextInt(3)
    val size    = (cube / 4).toDouble / (1 << random.nextInt(5))
    val centre  = Seq.fill(3)(between(cube * 3 / 8, cube * 5 / 8))
    val ring    = (0 until corners).map { i =>
      val angle  = 2 * math.Pi * (i + random.nextDouble() / 2) / corners
      val radius = size * (1 + random.nextDouble()) / 2
      val offset =
        Seq(math.cos(angle), math.sin(angle), (random.nextDouble() - 0.5) / 4).map(o => BigInt((o * radius).toLong))
      Seq(0, 1, 2).map(objectAxis => centre(objectAxis) + offset((objectAxis - axis + 2) % 3))
    }
    val part   = BigInt(random.nextInt(9))
    val spoke  = ring(random.nextInt(corners))
    val target = centre.zip(spoke).map { case (from, to) => steps(from) + (steps(to) - steps(from)) * part / 16 }
    val aimed  = rayTo(target, axis)
    val astray = aimed.copy(origin = aimed.origin.map(_ + random.nextInt(3) - 1))
    (astray, ring.indices.map(i => TestTriangle(random.shuffle(Seq(centre, ring(i), ring((i + 1) % corners))))))
  }

  private def inCube(coordinate: BigInt): BigInt = coordinate.max(0).min(cube - 1)

  /** A ray aimed at a point of the cube, given in grid steps, from an origin before it. */
  def rayTo(target: Seq[BigInt], axis: Int = random.nextInt(3)): TestRay = {
    val shears     = Seq.fill(2)(shear)
    val isNegative = random.nextBoolean()
    val aim        = Seq(1, 2, 0).map(offset => target((axis + offset) % 3))
    val along      = between(reach / 2, reach)
    val start      = Seq(0, 1).map(a => aim(a) - roundedEven(shears(a) * along)) :+
      (if (isNegative) aim(2) + along else aim(2) - along)
    TestRay(axis, shears.map(_ < 0) :+ isNegative, start.map(_.max(-reach).min(3 * reach)), shears)
  }

  private def roundedEven(product: BigInt): BigInt = {
    val (bits, half)  = (numbers.shearFraction, one / 2)
    val (floor, rest) = (product >> bits, product & (one - 1))
    if (rest > half || (rest == half && floor.testBit(0))) floor + 1 else floor
  }

  def expected(rays: Seq[(TestRay, TestTriangle)]): Seq[ExpectedHit] = {
    def flag(value: Boolean): BigInt = if (value) 1 else 0
    val questions                    = rays.map { case (ray, triangle) =>
      (BigInt(ray.axis) +: ray.negative.map(flag)) ++ ray.origin ++ ray.shear ++ triangle.vertices.flatten
    }
    Model.answers(config, questions, "triangle").map { answer =>
      ExpectedHit(answer.head == 1, answer(1), answer.slice(2, 5), answer(5) == 1)
    }
  }
}
