package colonnade.refit

import colonnade.Model
import colonnade.axi.AxiMemory
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Layout, LeafRecord, RecordFormats}

import scala.collection.mutable
import scala.util.Random

/** Records of a tree over leaves, in which only what stays is written, vertices for them, and what the C of a target
  * does with both.
  *
  * @param leaves   vertices of each leaf, the fourth of a triangle -1
  * @param vertices position and normal of each
  */
final class BentMesh(
    config:       ColonnadeConfig,
    random:       Random,
    leaves:       Seq[Seq[Int]],
    val vertices: Seq[Seq[Int]],
    val root:     Int,
    leafRecords:  Int
) {
  private val formats = new RecordFormats(config)
  private val layouts = formats.kinds.map { case (name, kind) =>
    name -> Layout.of(kind).map(field => field.name -> field.offset).toMap
  }.toMap

  val records: Seq[BigInt] = build()
  private lazy val depths          = mutable.ArrayBuffer.empty[Int]
  private lazy val found           = mutable.ArrayBuffer.empty[BigInt]
  private def build(): Seq[BigInt] = {
    found += 0
    node(0, leaves.size, 1)
    found.toSeq
  }

  private def field(layout: String, name: String, value: BigInt): BigInt = value << layouts(layout)(name)

  private def node(address: Int, count: Int, depth: Int): Unit = {
    depths += depth
    val children = count.min(2) + random.nextInt(count.min(4) - count.min(2) + 1)
    val own      = if (children == count) children else random.nextInt(children)
    val below    = children - own
    val first    = found.size
    found(address) = field("node", "first", root + first) + field("node", "nodes", below) + field("node", "leaves", own)
    found ++= Seq.fill(below)(BigInt(0))
    for (_ <- 0 until own) {
      found += field("nearPair", "material", random.nextInt(256)) + field("nearPair", "isClear", random.nextInt(2))
      found ++= Seq.fill(leafRecords - 1)(BigInt(256, random))
    }
    val rest = count - own
    for (child <- 0 until below) node(first + child, rest / below + (if (child < rest % below) 1 else 0), depth + 1)
  }

  private def offsets: Seq[Int] = {
    def of(layout: String, names: Seq[String])                = names.map(layouts(layout))
    val (axes, codes)                                         = (Seq("x", "y", "z"), Seq("u", "v"))
    def vectors(name: String, count: Int, parts: Seq[String]) =
      for (i <- 0 until count; part <- parts) yield s"body.$name[$i].$part"
    val boxes =
      for (child <- 0 until 4; plane <- Seq("low", "high"); axis <- axes) yield s"children[$child].$plane.$axis"
    of("node", boxes ++ axes.map(axis => s"corner.$axis") ++ Seq("first", "leaves", "nodes")) ++
      of("flatPair", vectors("vertices", 4, axes)) ++ of("nearPair", vectors("deltas", 3, axes)) ++
      of("farPair", vectors("signs", 3, axes)) ++ of("triangle", vectors("normals", 3, codes)) ++
      of(
        "nearPair",
        vectors("normals", 4, codes) ++ vectors("lowBits", 4, codes) ++ Seq("format", "material", "isClear")
      )
  }

  /** What the C writes. */
  private lazy val result: Seq[BigInt] = {
    val geometry = config.geometry
    val numbers  = Seq(geometry.vertexBits, LeafRecord.deltaBits(geometry), geometry.boxBits, formats.addressBits) ++
      Seq(leafRecords, records.size, depths.max, vertices.size, leaves.size, root)
    val corners = leaves.flatten.map(vertex => BigInt(vertex) & 0xffffffffL)
    Model.refit(
      (numbers ++ offsets).map(BigInt(_)) ++ corners ++ vertices.flatten.map(BigInt(_)) ++ records.flatMap(words)
    )
  }

  def entries: Int        = result.head.toInt
  def lines: Int          = (vertices.size + RefitPlan.lineEntries - 1) / RefitPlan.lineEntries
  def triangles: Int      = leaves.map(_.count(_ >= 0) - 2).sum
  private def rest        = result.drop(1 + 4 * entries)
  def flatPairs: BigInt   = rest.head
  def bounds: Seq[BigInt] = rest.slice(1, 7)

  /** The settings of a refit, by name. */
  def settings: Seq[(String, BigInt)] = Seq[(String, BigInt)](
    "plan"     -> BentMesh.plan,
    "vertices" -> BentMesh.vertices,
    "records"  -> BentMesh.records,
    "entries"  -> entries,
    "lines"    -> lines,
    "count"    -> records.size,
    "root"     -> root
  )

  def store(memory: AxiMemory): Unit = {
    memory.store(BentMesh.plan, result.slice(1, 1 + 4 * entries))
    memory.store(
      BentMesh.vertices,
      vertices.flatMap(v => v.take(3).map(BigInt(_)) :+ (BigInt(v(4) & 0xffff) << 16 | BigInt(v(3) & 0xffff)))
    )
    memory.store(BentMesh.records, records.flatMap(words))
    memory.written.clear()
    memory.read.clear()
  }

  /** Numbers of records that are not those of the C. */
  def wrong(memory: AxiMemory): Seq[Int] = {
    def bytes(words: Seq[BigInt]) = words.flatMap(word => (0 until 4).map(byte => ((word >> (8 * byte)) & 255).toInt))
    rest.drop(7).grouped(8).zipWithIndex.collect {
      case (words, i) if memory.dump(BentMesh.records + 32 * i, 32) != bytes(words) => i
    }.toSeq
  }

  private def words(record: BigInt): Seq[BigInt] = Seq.tabulate(8)(i => record >> (32 * i) & 0xffffffffL)
}

object BentMesh {

  /** Addresses in memory. */
  val plan:     BigInt = 0x1000
  val vertices: BigInt = 0x100000
  val records:  BigInt = 0x200020

  /** A square of pairs, in which some leaves are triangles, along a curve that stays near.
    *
    * @param edge of the square, a power of two
    * @param cell edge of a pair, on the grid; vertices are shifted by up to half of it
    */
  def apply(config: ColonnadeConfig, random: Random, edge: Int, cell: Int, root: Int, leafRecords: Int): BentMesh = {
    val numbers                = mutable.LinkedHashMap.empty[(Int, Int), Int]
    def vertex(x: Int, y: Int) = numbers.getOrElseUpdate((x, y), numbers.size)
    val leaves                 = for (i <- 0 until edge * edge) yield {
      val Seq(x, y) = Seq(i, i >> 1).map(bits => (0 until 12).map(bit => (bits >> (2 * bit) & 1) << bit).sum)
      Seq(vertex(x + 1, y), vertex(x, y + 1), vertex(x, y), if (random.nextInt(8) == 0) -1 else vertex(x + 1, y + 1))
    }
    val most     = (1 << config.geometry.vertexBits) - 1
    val vertices = numbers.keys.toSeq.map { case (x, y) =>
      val middle   = Seq(x, y, x * y / edge).map(_ * cell)
      val position = middle.map(value => (value + random.nextInt(cell + 1) - cell / 2).max(0).min(most))
      position ++ Seq.fill(2)(random.nextInt(2048) - 1024)
    }
    new BentMesh(config, random, leaves, vertices, root, leafRecords)
  }
}
