package colonnade.unit

import colonnade.Packed
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{Leaf => LeafFormats, LeafRecord, NodeRecord, Octahedral, RecordFormats}

import scala.collection.mutable
import scala.util.Random

/** A few large triangles in the object's cube with a camera in front of it: records in the packer's layout, and
  * registers. Nodes hold groups of leaves, split along x.
  */
final class SmallScene(
    config:        ColonnadeConfig,
    seed:          Int,
    wide:          Int,
    high:          Int,
    triangleCount: Int,
    shadows:       Boolean
) {
  private type Point = Seq[Int]
  private type Leaf  = Seq[Point] // the vertices of a triangle or of a pair

  private val random   = new Random(seed)
  private val numbers  = config.numbers
  private val formats  = new RecordFormats(config)
  private val vertices = 1 << numbers.vertexBits
  private val firsts   = mutable.Map.empty[Int, Int] // position of the first child by the node's position

  private val leaves: Vector[Leaf] =
    Seq.fill(triangleCount / LeafFormats.maxTriangles + 3)(leaf()).sortBy(_.map(_.head).take(3).sum).toVector

  /** A node as groups of leaves, breadth first; or a leaf. Without a tree there are leaves alone. */
  private val ordered: Vector[Either[Seq[Vector[Leaf]], Leaf]] =
    if (config.geometry.bvh) {
      var known = Vector[Either[Seq[Vector[Leaf]], Leaf]](Left(cut(leaves)))
      var built = 0
      while (built < known.size) {
        for (groups <- known(built).left) {
          firsts(built) = known.size
          known ++= groups.filter(_.size > 1).map(group => Left(cut(group))) ++
            groups.filter(_.size == 1).map(group => Right(group.head))
        }
        built += 1
      }
      known
    } else leaves.map(Right(_))

  /** Of a leaf: itself and its companion. */
  private val leafRecords = if (config.geometry.cornerColours) 2 else 1
  private val addresses: Vector[Int] = ordered.scanLeft(0)((at, each) => at + each.fold(_ => 1, _ => leafRecords))

  val leafAddresses: Vector[Int] = ordered.zip(addresses).collect { case (Right(_), address) => address }

  val records: Seq[BigInt] =
    ordered.zipWithIndex.flatMap {
      case (Left(groups), at) => Seq(node(groups.sortBy(_.size == 1), addresses(firsts(at))))
      case (Right(leaf), _)   => record(leaf) +: Seq.fill(leafRecords - 1)(colours())
    }

  /** The host's registers, by name. */
  val registers: Map[String, BigInt] = {
    val cube      = BigInt(1) << (numbers.vertexBits + numbers.gridFraction) // grid steps
    val unitShift = 4
    val forwards  = BigInt(1) << (numbers.macBits - 5)
    val step      = forwards / wide
    def at(x: BigInt, y: BigInt, z: BigInt): Seq[BigInt] = Seq(x, y, z).map(_ >> unitShift)

    val points = leaves.flatten
    val scene  = Map("recordCount" -> records.size, "root" -> 0) ++
      Option.when(config.geometry.cornerColours)("hasColours" -> 1)
    val materials = Seq.tabulate(config.frame.materials) { i =>
      vector(s"materials[$i].albedo", "rgb", Seq.fill(3)(BigInt(1000 + random.nextInt(3000)))) ++
        (if (config.frame.hasBounces) glossy(i) else Map.empty[String, BigInt]) ++
        (if (config.geometry.cornerColours) Map(s"materials[$i].hasCornerColours" -> BigInt(seed >> i & 1))
         else Map.empty[String, BigInt]) ++
        (if (config.frame.emission) vector(s"materials[$i].emission", "rgb", Seq.fill(3)(BigInt(random.nextInt(2000))))
         else Map.empty[String, BigInt])
    }
    val lights = Seq.tabulate(config.frame.lights) { i =>
      vector(s"lights[$i].position", "xyz", at(cube / 4 + cube * i / 2, cube * 3 / 2, -cube)) ++
        vector(s"lights[$i].colour", "rgb", Seq(4000, 3000, 2500).map(_ / (i + 1))) ++ reach(cube, i)
    }
    val bounces =
      if (config.frame.hasBounces) Map("bounces" -> config.frame.maxBounces, "shadowTransmittance" -> 2500)
      else Map.empty[String, Int]
    Map[String, BigInt](
      "frame.width"          -> wide,
      "frame.height"         -> high,
      "frame.unitShift"      -> unitShift,
      "frame.objectRect.x0"  -> 0,
      "frame.objectRect.x1"  -> wide,
      "frame.objectRect.y1"  -> high,
      "camera.stepShift"     -> 2,
      "shading.offset"       -> (cube >> 8).max(1),
      "shading.lights"       -> config.frame.lights,
      "shading.flat"         -> seed % 2,
      "shading.shadows"      -> (if (shadows) 1 else 0),
      "frame.objectRect.y0"  -> 0,
      "frame.watchdogCycles" -> 0
    ) ++ scene.map { case (name, value) => s"scene.$name" -> BigInt(value) } ++ bounces.map { case (name, value) =>
      s"shading.$name" -> BigInt(value)
    } ++
      materials.flatten ++ lights.flatten ++
      vector("camera.position", "xyz", at(cube / 2, cube / 2, -cube)) ++
      vector("camera.direction", "xyz", Seq(-step * wide / 2 + 1, step * high / 2, forwards).map(_ >> 2)) ++
      vector("camera.stepX", "xyz", Seq(step, 0, 0)) ++
      vector("camera.stepY", "xyz", Seq(0, -step, 0)) ++
      vector("ambient", "rgb", Seq(500, 600, 700)) ++
      vector("background", "rgb", Seq(100, 200, 300)) ++
      vector("bounds.low", "xyz", (0 until 3).map(axis => BigInt(points.map(_(axis)).min))) ++
      vector("bounds.high", "xyz", (0 until 3).map(axis => BigInt(points.map(_(axis)).max)))
  }

  /** Every second light has falloff: a squared distance as mantissa and exponent. */
  private def reach(cube: BigInt, light: Int): Map[String, BigInt] = {
    val square = if (light % 2 == 0) BigInt(0) else cube * cube * 3
    val drop   = square.bitLength - numbers.mantissaBits
    Map(
      s"lights[$light].reachMantissa" -> (if (drop < 0) square << -drop else square >> drop),
      s"lights[$light].reachExponent" -> BigInt(drop)
    )
  }

  /** Every second material is a mirror or glass. */
  private def glossy(material: Int): Map[String, BigInt] = {
    val one = BigInt(1) << NumberFormats.etaFraction
    Map[String, BigInt](
      "kind"        -> (if (material % 2 == 0) 0 else 1 + seed % 2),
      "etaFront"    -> one * 2 / 3,
      "etaBack"     -> one * 3 / 2,
      "reflectance" -> 164
    ).map { case (name, value) => s"materials[$material].$name" -> value }
  }

  private def vector(name: String, parts: String, values: Seq[BigInt]): Map[String, BigInt] =
    parts.zip(values).map { case (part, value) => s"$name.$part" -> value }.toMap

  /** A triangle or a pair, of any format. */
  private def leaf(): Leaf = {
    val size   = 3 + random.nextInt(2)
    val reach  = vertices * 2 / 5 >> (if (size == 4 && random.nextInt(3) == 0) 3 + random.nextInt(3) else 0)
    val middle = Seq.fill(3)(reach + random.nextInt(vertices - 2 * reach))
    Seq.fill(size)(middle.map(_ + random.nextInt(2 * reach) - reach))
  }

  private def cut(these: Vector[Leaf]): Seq[Vector[Leaf]] =
    these.grouped((these.size + NodeRecord.most - 1) / NodeRecord.most).toSeq

  private def node(groups: Seq[Vector[Leaf]], first: BigInt): BigInt = {
    val limit                                = (1 << numbers.boxBits) - 1
    val axes                                 = "xyz".zipWithIndex
    def ends(group: Vector[Leaf], axis: Int) = {
      val values = group.flatten.map(_(axis))
      (values.min, values.max)
    }
    val whole    = axes.map { case (_, axis) => ends(groups.toVector.flatten, axis) }
    val exponent = whole.map { case (low, high) =>
      LazyList.from(0).find(e => (high >> e) + 1 - (low >> e) <= limit).get
    }
    val nodes  = groups.count(_.size > 1)
    val fields = Map[String, BigInt]("first" -> first, "nodes" -> nodes, "leaves" -> (groups.size - nodes)) ++
      axes.map { case (name, axis) =>
        s"corner.$name" -> BigInt((2 * (whole(axis)._1 >> exponent(axis)) + 1) << exponent(axis))
      } ++
      groups.zipWithIndex.flatMap { case (group, slot) =>
        axes.flatMap { case (name, axis) =>
          val (low, high) = ends(group, axis)
          val origin      = whole(axis)._1 >> exponent(axis)
          Seq(
            s"children[$slot].low.$name"  -> BigInt((low >> exponent(axis)) - origin),
            s"children[$slot].high.$name" -> BigInt((high >> exponent(axis)) + 1 - origin)
          )
        }
      }
    new Packed(formats.node).pack(fields)
  }

  /** In the format that holds it; normals are near those of the first triangle, with any lowest bits. */
  private def record(leaf: Leaf): BigInt = {
    val deltas = leaf.tail.map(_.zip(leaf.head).map { case (to, from) => BigInt(to - from) })
    val bits   = LeafRecord.deltaBits(config.geometry)
    val length = deltas.flatten.map(delta => if (delta < 0) ~delta else delta).max.bitLength
    val codes  = leaf.map(_ => code(normal(leaf)))

    def points(name: String, values: Seq[Seq[BigInt]]): Map[String, BigInt] =
      values.zipWithIndex.flatMap { case (value, i) => vector(s"body.$name[$i]", "xyz", value) }.toMap
    def normals(drop: Int): Map[String, BigInt] =
      codes.zipWithIndex.flatMap { case (code, i) => vector(s"body.normals[$i]", "uv", code.map(_ >> drop)) }.toMap
    val absolute       = points("vertices", leaf.map(_.map(BigInt(_))))
    val relative       = vector("body.vertex", "xyz", leaf.head.map(BigInt(_))) ++ normals(1)
    val (kind, fields) =
      if (leaf.size == 3) (1, absolute ++ normals(0))
      else if (length < bits)
        (0, relative ++ points("deltas", deltas) ++ codes.indices.map(i => s"body.lowBits[$i].u" -> BigInt(i % 2)))
      else if (length > bits) (2, absolute)
      else {
        val low = deltas.map(_.map(_ & ((BigInt(1) << bits) - 1)))
        (
          3,
          relative ++ points("deltas", low) ++ points(
            "signs",
            deltas.map(_.map(delta => BigInt(if (delta < 0) 1 else 0)))
          )
        )
      }
    new Packed(SmallScene.kinds(config)(kind)).pack(fields ++ Map(
      "format"   -> BigInt(kind),
      "isClear"  -> BigInt(random.nextInt(2)),
      "material" -> BigInt(random.nextInt(config.frame.materials))
    ))
  }

  private def normal(face: Seq[Point]): Seq[Double] = {
    val Seq(edge1, edge2) = face.slice(1, 3).map(_.zip(face.head).map { case (a, b) => (a - b).toDouble })
    val normal            = (0 until 3).map { axis =>
      val (u, v) = ((axis + 1) % 3, (axis + 2) % 3)
      edge1(u) * edge2(v) - edge1(v) * edge2(u)
    }
    val length = math.sqrt(normal.map(n => n * n).sum)
    normal.map(_ / length + random.nextDouble() - 0.5)
  }

  private def code(normal: Seq[Double]): Seq[BigInt] = {
    val one          = (1 << (Octahedral.bits - 1)) - 1
    val Seq(u, v, z) = normal.map(x => (x / normal.map(_.abs).sum * one).round)
    val folded       =
      if (z >= 0) Seq(u, v) else Seq((one - v.abs) * (if (u < 0) -1 else 1), (one - u.abs) * (if (v < 0) -1 else 1))
    folded.map(BigInt(_))
  }

  private def colours(): BigInt =
    new Packed(formats.kinds.toMap.apply("colours")).pack(
      (0 until LeafFormats.maxVertices).flatMap(i => vector(s"colours[$i]", "rgb", Seq.fill(3)(anyColour))).toMap
    )

  private def anyColour: BigInt = BigInt(NumberFormats.colourBits, random.self)
}

object SmallScene {

  /** The formats of leaves, by their number. */
  def kinds(config: ColonnadeConfig): Seq[chisel3.Data] = {
    val kinds = LeafRecord.kinds(config.geometry).toMap
    Seq("nearPair", "triangle", "flatPair", "farPair").map(kinds)
  }
}
