package colonnade.traversal

import colonnade.Model
import colonnade.config.ColonnadeConfig
import colonnade.traversal.StackReference.Child

import scala.util.Random

/** A random tree a few nodes deep, random rays, and which children each ray enters, by the model. */
final class SmallTree(config: ColonnadeConfig, rayCount: Int, seed: Int) {
  import SmallTree._

  private val random = new Random(seed)
  private val arity  = config.geometry.arity

  /** Nodes by address: their halves of a question. Children of a kind are consecutive, in slot order. */
  val nodes: Vector[BoxQuestion] = {
    val questions = new BoxQuestions(config, seed)
    var depths    = Vector(0) // of all nodes known so far, by address
    var leaves    = 0
    var grown     = Vector.empty[BoxQuestion]
    while (grown.size < depths.size) {
      val depth = depths(grown.size)
      val kinds = Seq.tabulate(arity)(slot => if (depth == 0 && slot < 2) node else kind(depth))
      grown :+= boxes(questions(1).head, isRoot = depth == 0).copy(
        kinds = kinds,
        firstChild = depths.size,
        firstTriangles = firstLeaf + leaves
      )
      depths ++= kinds.filter(_ == node).map(_ => depth + 1)
      leaves += kinds.count(_ == leaf)
    }
    grown
  }

  /** The rays' halves of a question: of many those that enter most of the root's children. */
  val rays: Vector[BoxQuestion] = {
    val many    = new BoxQuestions(config, seed + 1)(4 * rayCount)
    val entered = Model.answers(config, many.map(against(_, nodes.head).words), "box").map(_(1))
    many.zip(entered).sortBy(-_._2).take(rayCount).map(_._1).toVector
  }

  /** Fields of [[BoxCandidate]] of a ray or a node, by their name behind `prefix`. */
  def fields(question: BoxQuestion, prefix: String): Map[String, BigInt] =
    question.fields(0).collect { case (name, value) if name.startsWith(prefix) => name.stripPrefix(prefix) -> value }

  /** By ray and node: the children that the ray enters when nothing limits it, near to far. */
  private val entered: Map[(Int, Int), Seq[Child]] = {
    val pairs = for (ray <- rays.indices; address <- nodes.indices) yield (ray, address)
    val asked = pairs.map { case (ray, address) => against(rays(ray), nodes(address)) }
    pairs.zip(BoxQuestions.solved(config, asked).map { case (_, result) =>
      (0 until result("count").toInt).map { i =>
        val child = s"children[$i]"
        Child(result(s"$child.visit.isLeaf") == 1, result(s"$child.visit.address"), result(s"$child.near"))
      }
    }).toMap
  }

  /** The children of a node that a ray enters no farther away than `limit`, in units. */
  def children(ray: Int, address: Int, limit: BigInt): Seq[Child] = entered((ray, address)).filter(_.near <= limit)

  /** All leaves that a ray reaches, without regard to their order. */
  def leaves(ray: Int, limit: BigInt): Set[Int] = {
    def below(address: Int): Set[Int] = children(ray, address, limit).flatMap { child =>
      if (child.isLeaf) Set(child.address.toInt) else below(child.address.toInt)
    }.toSet
    below(0)
  }

  /** A ray that nothing limits against a node. */
  private def against(ray: BoxQuestion, node: BoxQuestion): BoxQuestion = ray.copy(
    limit = (BigInt(1) << (config.numbers.gridBits - 1)) - 1,
    origin = node.origin,
    shift = node.shift,
    kinds = node.kinds,
    low = node.low,
    high = node.high,
    firstChild = node.firstChild,
    firstTriangles = node.firstTriangles
  )

  private def kind(depth: Int): Int =
    if (depth == deepest) Seq(0, leaf, leaf)(random.nextInt(3)) else Seq(0, node, node, leaf)(random.nextInt(4))

  /** The root's boxes are the cube; half of the others reach across its middle, the rest are as they come. */
  private def boxes(question: BoxQuestion, isRoot: Boolean): BoxQuestion = {
    val numbers = config.numbers
    val top     = (1 << (numbers.boxBits - 1)) - 1
    val planes  = Seq.fill(arity) {
      if (isRoot) Seq.fill(3)((0, top))
      else if (random.nextBoolean()) Seq.fill(3)((random.nextInt(top / 3), top - random.nextInt(top / 3)))
      else
        Seq.fill(3) {
          val ends = Seq.fill(2)(random.nextInt(top + 1))
          (ends.min, ends.max)
        }
    }
    question.copy(
      origin = Seq.fill(3)(BigInt(0)),
      shift = Seq.fill(3)(numbers.vertexBits - numbers.boxBits + 1),
      low = planes.map(_.map(plane => BigInt(plane._1))),
      high = planes.map(_.map(plane => BigInt(plane._2)))
    )
  }
}

object SmallTree {

  /** Address of the first leaf's record. */
  val firstLeaf: Int = 512

  private val deepest = 3
  private val node    = 1
  private val leaf    = 2
}
