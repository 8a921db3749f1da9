package colonnade.traversal

import colonnade.Model
import colonnade.config.ColonnadeConfig
import colonnade.formats.NodeRecord
import colonnade.traversal.StackReference.Child

import scala.util.Random

/** A random tree of a few levels and random rays; the model says which children each ray enters. */
final class SmallTree(config: ColonnadeConfig, rayCount: Int, seed: Int) {
  import SmallTree._

  private val random = new Random(seed)
  private val arity  = NodeRecord.most

  /** Nodes by address, as cases without a ray; none at the address of a leaf. */
  private val records: Vector[Option[BoxCase]] = {
    val cases  = new BoxStimulus(config, seed)
    var depths = Vector(Option(0)) // by address; none for a leaf
    var grown  = Vector.empty[Option[BoxCase]]
    while (grown.size < depths.size) {
      grown :+= depths(grown.size).map { depth =>
        val kinds  = Seq.tabulate(arity)(slot => if (depth == 0 && slot < 2) node else kind(depth))
        val nodes  = kinds.count(_ == node)
        val leaves = kinds.count(_ == leaf)
        val first  = depths.size
        depths ++= Seq.fill(nodes)(Some(depth + 1)) ++ Seq.fill(leaves)(None)
        boxes(cases(1).head, isRoot = depth == 0).copy(nodes = nodes, leaves = leaves, first = first)
      }
    }
    grown
  }

  /** Nodes by address. */
  val nodes: Map[Int, BoxCase] =
    records.zipWithIndex.collect { case (Some(node), address) => address -> node }.toMap

  /** Rays, as cases without a node: those of many random ones that enter most of the root's children. */
  val rays: Vector[BoxCase] = {
    val many    = new BoxStimulus(config, seed + 1)(4 * rayCount)
    val entered = Model.answers(config, many.map(against(_, nodes(0)).words), "box").map(_(1))
    many.zip(entered).sortBy(-_._2).take(rayCount).map(_._1).toVector
  }

  /** Fields of [[BoxCandidate]] of a ray or a node, by their name after `prefix`. */
  def fields(testCase: BoxCase, prefix: String): Map[String, BigInt] =
    testCase.fields(0).collect { case (name, value) if name.startsWith(prefix) => name.stripPrefix(prefix) -> value }

  /** By ray and node: the children that an unlimited ray enters, sorted by entry distance. */
  private val entered: Map[(Int, Int), Seq[Child]] = {
    val pairs = for (ray <- rays.indices; address <- nodes.keys.toSeq.sorted) yield (ray, address)
    val asked = pairs.map { case (ray, address) => against(rays(ray), nodes(address)) }
    pairs.zip(BoxStimulus.solved(config, asked).map { case (_, result) =>
      (0 until result("count").toInt).map { i =>
        val child = s"children[$i]"
        Child(result(s"$child.target.isLeaf") == 1, result(s"$child.target.address"), result(s"$child.tNear"))
      }
    }).toMap
  }

  /** The children of a node that a ray enters no farther away than `tMax`, in units. */
  def children(ray: Int, address: Int, tMax: BigInt): Seq[Child] = entered((ray, address)).filter(_.tNear <= tMax)

  /** All leaves that a ray reaches, in any order. */
  def leaves(ray: Int, tMax: BigInt): Set[Int] = {
    def below(address: Int): Set[Int] = children(ray, address, tMax).flatMap { child =>
      if (child.isLeaf) Set(child.address.toInt) else below(child.address.toInt)
    }.toSet
    below(0)
  }

  /** An unlimited ray against a node. */
  private def against(ray: BoxCase, node: BoxCase): BoxCase = ray.copy(
    tMax = (BigInt(1) << (config.numbers.gridBits - 1)) - 1,
    origin = node.origin,
    shift = node.shift,
    nodes = node.nodes,
    leaves = node.leaves,
    low = node.low,
    high = node.high,
    first = node.first
  )

  private def kind(depth: Int): Int =
    if (depth == deepest) Seq(0, leaf, leaf)(random.nextInt(3)) else Seq(0, node, node, leaf)(random.nextInt(4))

  /** The root's boxes are the cube; half of the others cross its centre, the rest are random. */
  private def boxes(testCase: BoxCase, isRoot: Boolean): BoxCase = {
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
    testCase.copy(
      origin = Seq.fill(3)(BigInt(0)),
      shift = Seq.fill(3)(numbers.vertexBits - numbers.boxBits + 1),
      low = planes.map(_.map(plane => BigInt(plane._1))),
      high = planes.map(_.map(plane => BigInt(plane._2)))
    )
  }
}

object SmallTree {

  private val deepest = 3
  private val node    = 1
  private val leaf    = 2
}
