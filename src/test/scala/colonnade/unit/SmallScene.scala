package colonnade.unit

import colonnade.Packed
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{NodeRecord, RecordFormats, TrianglesRecord}

import scala.util.Random

/** A few large triangles in the object's cube with a camera in front of it: records in the packer's layout, and registers.
  * Nodes hold groups of leaves, split along x.
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
  private type Leaf  = Seq[Seq[Point]]

  private val random   = new Random(seed)
  private val numbers  = config.numbers
  private val formats  = new RecordFormats(config)
  private val vertices = 1 << numbers.vertexBits

  private val leaves: Vector[Leaf] =
    Seq.fill(triangleCount)(triangle()).sortBy(_.map(_.head).sum).grouped(TrianglesRecord.most).toVector

  /** Nodes as groups of leaves, breadth first, none without a tree; leaves in the order of their records. */
  private val (nodes, ordered) = {
    var known = if (config.geometry.bvh) Vector(leaves) else Vector.empty[Vector[Leaf]]
    var found = if (config.geometry.bvh) Vector.empty[Leaf] else leaves
    var built = Vector.empty[BigInt => BigInt] // of the first triangles record's address
    while (built.size < known.size) {
      val groups     = cut(known(built.size))
      val firstChild = known.size
      val firstLeaf  = found.size
      built :+= (triangleBase => node(groups, firstChild, triangleBase + firstLeaf))
      known ++= groups.filter(_.size > 1)
      found ++= groups.filter(_.size == 1).flatten
    }
    (built, found)
  }

  val records: Seq[BigInt] =
    nodes.map(_(nodes.size)) ++
      ordered.map(triangles) ++
      ordered.flatMap(leaf => leaf.padTo(TrianglesRecord.most, leaf.head)).grouped(
        RecordFormats.facesPerRecord(config)
      ).map(attributes)

  /** The host's registers, by name. */
  val registers: Map[String, BigInt] = {
    val cube      = BigInt(1) << (numbers.vertexBits + numbers.gridFraction) // grid steps
    val unitShift = 4
    val forwards  = BigInt(1) << (numbers.macBits - 5)
    val step      = forwards / wide
    def at(x: BigInt, y: BigInt, z: BigInt): Seq[BigInt] = Seq(x, y, z).map(_ >> unitShift)

    val points = leaves.flatten.flatten
    val scene  = Map(
      "recordCount"     -> records.size,
      "triangleBase"    -> nodes.size,
      "triangleRecords" -> ordered.size,
      "attributeBase"   -> (nodes.size + ordered.size)
    )
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

  private def triangle(): Seq[Point] = {
    val reach  = vertices * 2 / 5
    val middle = Seq.fill(3)(reach + random.nextInt(vertices - 2 * reach))
    Seq.fill(3)(middle.map(_ + random.nextInt(2 * reach) - reach))
  }

  private def cut(these: Vector[Leaf]): Seq[Vector[Leaf]] =
    these.grouped((these.size + NodeRecord.children - 1) / NodeRecord.children).toSeq

  private def node(groups: Seq[Vector[Leaf]], firstChild: BigInt, firstTriangles: BigInt): BigInt = {
    val limit                                = (1 << numbers.boxBits) - 1
    val axes                                 = "xyz".zipWithIndex
    def ends(group: Vector[Leaf], axis: Int) = {
      val values = group.flatten.flatten.map(_(axis))
      (values.min, values.max)
    }
    val whole    = axes.map { case (_, axis) => ends(groups.toVector.flatten, axis) }
    val exponent = whole.map { case (low, high) => LazyList.from(0).find(e => ((high - low) >> e) < limit).get }
    val fields   = Map("firstChild" -> firstChild, "firstTriangles" -> firstTriangles) ++
      axes.map { case (name, axis) => s"origin.$name" -> BigInt(whole(axis)._1) } ++
      axes.map { case (name, axis) => s"exponent.$name" -> BigInt(exponent(axis)) } ++
      groups.zipWithIndex.flatMap { case (group, slot) =>
        (s"kinds[$slot]" -> BigInt(if (group.size > 1) 1 else 2)) +: axes.flatMap { case (name, axis) =>
          val (low, high) = ends(group, axis)
          Seq(
            s"low[$slot].$name"  -> BigInt((low - whole(axis)._1) >> exponent(axis)),
            s"high[$slot].$name" -> BigInt(((high - whole(axis)._1) >> exponent(axis)) + 1)
          )
        }
      }
    new Packed(formats.node).pack(fields)
  }

  private def triangles(leaf: Leaf): BigInt = {
    val points = leaf.flatten.zipWithIndex.flatMap { case (point, i) =>
      vector(s"vertices[$i]", "xyz", point.map(BigInt(_)))
    }
    new Packed(formats.triangles).pack(
      points.toMap ++ Map("count" -> BigInt(leaf.size)) ++
        leaf.indices.map(k => s"isClear[$k]" -> BigInt(random.nextInt(2)))
    )
  }

  private def attributes(faces: Seq[Seq[Point]]): BigInt =
    new Packed(formats.attributes).pack(faces.zipWithIndex.flatMap { case (face, slot) =>
      val Seq(edge1, edge2) = face.tail.map(_.zip(face.head).map { case (a, b) => (a - b).toDouble })
      val normal            = (0 until 3).map { axis =>
        val (u, v) = ((axis + 1) % 3, (axis + 2) % 3)
        edge1(u) * edge2(v) - edge1(v) * edge2(u)
      }
      val length  = math.sqrt(normal.map(n => n * n).sum)
      val corners = (0 until 3).flatMap { corner =>
        vector(s"faces[$slot].normals[$corner]", "xyz", unit(normal.map(_ / length + random.nextDouble() - 0.5)))
      }
      val colours = if (config.geometry.cornerColours) 0 until 3 else Nil
      (corners ++ vector(s"faces[$slot].geometricNormal", "xyz", unit(normal))) ++
        colours.flatMap(corner => vector(s"faces[$slot].colours[$corner]", "rgb", Seq.fill(3)(anyColour))) :+
        (s"faces[$slot].material" -> BigInt(random.nextInt(config.frame.materials)))
    }.toMap)

  private def anyColour: BigInt = BigInt(NumberFormats.colourBits, random.self)

  private def unit(direction: Seq[Double]): Seq[BigInt] = {
    val length = math.sqrt(direction.map(d => d * d).sum)
    direction.map(d => BigInt(math.round(d / length * ((1 << NumberFormats.normalFraction) - 1))))
  }
}
