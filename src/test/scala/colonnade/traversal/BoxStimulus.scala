package colonnade.traversal

import colonnade.Model
import colonnade.config.ColonnadeConfig
import colonnade.formats.NodeRecord

import scala.util.Random

/** A ray and a node as integers; the ray's numbers are in its own frame. */
final case class BoxCase(
    axis:       Int,
    negative:   Seq[Boolean],
    boxOrigin:  Seq[BigInt],
    reciprocal: Seq[BigInt],
    exponent:   Seq[Int],
    tMax:       BigInt,
    origin:     Seq[BigInt],
    shift:      Seq[Int],
    nodes:      Int,
    leaves:     Int,
    low:        Seq[Seq[BigInt]],
    high:       Seq[Seq[BigInt]],
    first:      BigInt,
    context:    Int
) {

  /** The input of the model, in the format of vectors.cpp. */
  def words: Seq[BigInt] =
    (BigInt(axis) +: negative.map(sign => BigInt(if (sign) 1 else 0))) ++ boxOrigin ++ reciprocal ++ exponent.map(
      BigInt(_)
    ) ++
      Seq(tMax) ++ origin ++ shift.map(BigInt(_)) ++ Seq(nodes, leaves).map(BigInt(_)) ++
      low.indices.flatMap(slot => low(slot) ++ high(slot))

  /** The fields of [[BoxCandidate]] by name. Half of the origins are the unit below, and round up. */
  def fields(tMaxUnits: BigInt): Map[String, BigInt] = {
    val roundsUp                                  = boxOrigin.map(value => BigInt(if (value.testBit(1)) 1 else 0))
    def vector(name: String, values: Seq[BigInt]) = Seq("x", "y", "z").zip(values).map { case (axis, value) =>
      s"$name.$axis" -> value
    }
    def indexed(name: String, values: Seq[BigInt]) = values.zipWithIndex.map { case (value, i) =>
      s"$name[$i]" -> value
    }
    Map("context" -> BigInt(context), "tMax" -> tMaxUnits, "ray.orientation.axis" -> BigInt(axis)) ++
      indexed("ray.orientation.negative", negative.map(sign => BigInt(if (sign) 1 else 0))) ++ indexed(
        "ray.origin",
        boxOrigin.zip(roundsUp).map { case (value, up) => value - up }
      ) ++ indexed("ray.roundsUp", roundsUp) ++
      indexed("ray.reciprocal", reciprocal) ++ indexed("ray.exponent", exponent.map(BigInt(_))) ++
      vector("node.corner", origin.zip(shift).map { case (at, exponent) => 2 * at + (BigInt(1) << exponent) }) ++
      Map[String, BigInt]("node.first" -> first, "node.nodes" -> nodes, "node.leaves" -> leaves) ++
      low.indices.flatMap { slot =>
        vector(s"node.children[$slot].low", low(slot)) ++ vector(s"node.children[$slot].high", high(slot))
      }
  }
}

/** Random and directed cases within the guarantees of the packer and of ray set-up. */
final class BoxStimulus(config: ColonnadeConfig, seed: Int) {
  private val numbers  = config.numbers
  private val random   = new Random(seed)
  private val cube     = BigInt(1) << numbers.vertexBits
  private val lowest   = -cube / 2
  private val highest  = cube * 3 / 2
  private val farthest = (BigInt(1) << (numbers.gridBits - 1)) - 1
  private val address  = BigInt(config.columnBvhMemory.depth)

  def apply(count: Int): Seq[BoxCase] = Seq.fill(count)(one())

  /** Pairs of cases whose origins differ by one unit and whose numbers of entered children differ, so that an error of
    * one unit shows.
    */
  def atBoundaries(count: Int): Seq[BoxCase] = {
    def entered(cases: Seq[BoxCase]): Seq[BigInt] =
      Model.answers(config, cases.map(_.words), "box").map(_(1))
    def moved(testCase: BoxCase, axis: Int, to: BigInt) =
      testCase.copy(boxOrigin = testCase.boxOrigin.updated(axis, to))

    val any    = apply(400 * count).map(testCase => (testCase, random.nextInt(3)))
    val ends   = Seq(lowest, highest).map(end => any.map { case (testCase, axis) => moved(testCase, axis, end) })
    val counts = ends.map(entered)
    val start  = any.indices.filter(i => counts.head(i) != counts.last(i)).take(count)
    require(start.size == count, s"only ${start.size} of $count boundaries")
    // Bisect between two ends that differ, all cases at a time
    val axes  = start.map(any(_)._2)
    val first = start.map(i => (ends.head(i), ends.last(i)))
    val pairs = (0 to numbers.vertexBits + 1).foldLeft(first) { (pairs, _) =>
      val middles = pairs.zip(axes).map { case ((from, to), axis) =>
        moved(from, axis, (from.boxOrigin(axis) + to.boxOrigin(axis)) >> 1)
      }
      val counted = entered(pairs.map(_._1)).zip(entered(middles))
      pairs.zip(middles).zip(counted).map { case (((from, to), middle), (a, b)) =>
        if (a == b) (middle, to) else (from, middle)
      }
    }
    pairs.flatMap { case (from, to) => Seq(from, to) }
  }

  /** Children one behind the other along a ray that runs through them; in most cases the last slots are the nearest. */
  def alongRay(count: Int): Seq[BoxCase] = Seq.fill(count) {
    val any   = one()
    val shift = Seq.fill(3)(random.nextInt(numbers.vertexBits - numbers.boxBits))
    val most  = (BigInt(1) << numbers.boxBits) - 1
    val arity = NodeRecord.most
    val cuts  = Seq.fill(2 * arity)(below(most + 1)).sorted.grouped(2).map(pair => (pair.head, pair.last)).toSeq
    val along = if (any.negative.last) cuts else cuts.reverse // from the farthest to the nearest
    val boxes =
      (if (random.nextInt(4) == 0) random.shuffle(along) else along).map(Seq.fill(3)((BigInt(0), most)).updated(
        any.axis,
        _
      ))
    val origin = shift.map(exponent => below(cube / 2) >> exponent << exponent)
    val nodes  = random.nextInt(arity + 1)
    val sides  = Seq(1, 2).map(next => (any.axis + next) % 3).map(a => origin(a) + below((most << shift(a)) + 1))
    val before = (BigInt(1) << numbers.boxPadLog) + below(cube / 8)
    val start  = origin(any.axis)
    val behind = if (any.negative.last) start + (most << shift(any.axis)) + before else start - before
    any.copy(
      boxOrigin = sides :+ behind.max(lowest).min(highest),
      exponent = Seq.fill(2)((numbers.reciprocalFraction - random.nextInt(5)).max(0)),
      tMax = farthest,
      origin = origin,
      shift = shift,
      nodes = nodes,
      leaves = arity - nodes,
      low = boxes.map(_.map(_._1)),
      high = boxes.map(_.map(_._2))
    )
  }

  private def below(bound: BigInt): BigInt = BigInt(bound.bitLength + 8, random) % bound

  private def one(): BoxCase = {
    val shift  = Seq.fill(3)(random.nextInt(numbers.vertexBits - numbers.boxBits + 2))
    val origin = shift.map(s => below(cube).min(cube - 1) >> (if (random.nextInt(3) == 0) 0 else s.min(3)) >> s << s)
    val count  = if (random.nextInt(3) == 0) random.nextInt(NodeRecord.most) else NodeRecord.most
    val nodes  = random.nextInt(count + 1)
    val boxes  = Seq.fill(NodeRecord.most)(Seq.tabulate(3)(a => interval(shift(a))))
    BoxCase(
      axis = random.nextInt(3),
      negative = Seq.fill(3)(random.nextBoolean()),
      boxOrigin = Seq.tabulate(3)(_ => boxOrigin(origin, shift, boxes.flatten)),
      reciprocal = Seq.fill(2)(reciprocal()),
      exponent = Seq.fill(2)(exponent()),
      tMax = if (random.nextInt(4) == 0) farthest else below(farthest) >> random.nextInt(6),
      origin = origin,
      shift = shift,
      nodes = nodes,
      leaves = count - nodes,
      low = boxes.map(_.map(_._1)),
      high = boxes.map(_.map(_._2)),
      first = below(address - 4),
      context = random.nextInt(config.array.contexts)
    )
  }

  /** Low and high plane: any, equal, or across the node. Planes are less than two cubes from the corner. */
  private def interval(shift: Int): (BigInt, BigInt) = {
    val most   = ((BigInt(1) << numbers.boxBits) - 1).min((2 * cube - 1) >> shift)
    val planes = Seq(below(most + 1), below(most + 1)).sorted
    random.nextInt(6) match {
      case 0 => (planes(0), planes(0))
      case 1 => (BigInt(0), most)
      case _ => (planes(0), planes(1))
    }
  }

  /** Any legal origin, an extreme one, one inside the object's cube, or one on a plane. */
  private def boxOrigin(origin: Seq[BigInt], shift: Seq[Int], planes: Seq[(BigInt, BigInt)]): BigInt = {
    val axis        = random.nextInt(3)
    val (low, high) = planes(random.nextInt(planes.size))
    val onPlane     = origin(axis) + ((if (random.nextBoolean()) low else high) << shift(axis))
    (random.nextInt(6) match {
      case 0 => onPlane
      case 1 => if (random.nextBoolean()) lowest else highest
      case 2 => lowest + below(2 * cube)
      case _ => below(cube)
    }).max(lowest).min(highest)
  }

  /** Between a half and two, with the digits that set-up computes; 1 for a component that is 0. */
  private def reciprocal(): BigInt = {
    val digits = numbers.reciprocalDigits
    val raw    = random.nextInt(6) match {
      case 0 => BigInt(1) << digits
      case 1 => (BigInt(1) << (digits + 1)) - 1
      case _ => (BigInt(1) << (digits - 1)) + below(BigInt(3) << (digits - 1))
    }
    raw << (numbers.reciprocalFraction - digits)
  }

  private def exponent(): Int = random.nextInt(5) match {
    case 0 => numbers.reciprocalFraction
    case 1 => random.nextInt(numbers.reciprocalFraction + 1)
    case _ => random.nextInt(4)
  }
}

object BoxStimulus {

  /** How many of the cases enter a child later than one of a higher slot, by the model. */
  def falling(config: ColonnadeConfig, cases: Seq[BoxCase]): Int =
    Model.answers(config, cases.map(_.words), "box").count { answer =>
      val children = Seq.tabulate(answer(1).toInt)(i => (answer(2 + 2 * i), answer(3 + 2 * i)))
      children.zip(children.drop(1)).exists { case ((slot, t), (nextSlot, nextT)) => slot > nextSlot && t < nextT }
    }

  /** The unit's inputs and expected results, as fields of [[BoxCandidate]] and [[BoxResult]]. */
  def solved(config: ColonnadeConfig, cases: Seq[BoxCase]): Seq[(Map[String, BigInt], Map[String, BigInt])] = {
    val tMaxUnits = Model.answers(config, cases.map(testCase => Seq(testCase.tMax)), "limit").map(_.head)
    val answers   = Model.answers(config, cases.map(_.words), "box")
    for (((testCase, tMax), answer) <- cases.zip(tMaxUnits).zip(answers)) yield {
      val count    = answer(1).toInt
      val children =
        for (i <- 0 until count; (field, value) <- child(testCase, answer(2 + 2 * i).toInt, answer(3 + 2 * i)))
          yield s"children[$i].$field" -> value
      testCase.fields(tMax) ->
        (children.toMap ++ Map("context" -> BigInt(testCase.context), "tests" -> answer.head, "count" -> answer(1)))
    }
  }

  /** Children are consecutive, nodes first. */
  private def child(testCase: BoxCase, slot: Int, tNear: BigInt): Seq[(String, BigInt)] = {
    Seq(
      "target.isLeaf"  -> BigInt(if (slot < testCase.nodes) 0 else 1),
      "target.address" -> (testCase.first + slot),
      "tNear"          -> tNear
    )
  }
}
