package colonnade.query

import java.lang.Float.floatToRawIntBits

import colonnade.config.ColonnadeConfig
import colonnade.unit.SmallScene

import scala.util.Random

/** A batch: its mode, its words of rays, and the origin and tNear of a fan. */
final case class TestBatch(mode: BigInt, count: Int, ofFan: Seq[BigInt], rays: Seq[BigInt]) {
  val response: Int = (mode & 3).toInt
  def hitBytes: Int = response match {
    case 0 => 16 * count
    case 1 => 8 * count
    case _ => (count + 63) / 64 * 8
  }
  def query: Seq[BigInt] = Seq(mode, BigInt(count)) ++ ofFan ++ rays

  /** The descriptor's words. */
  def words(rays: BigInt, hits: BigInt, tag: BigInt, done: BigInt): Seq[BigInt] = {
    def wide(value: BigInt) = Seq(value & 0xffffffffL, value >> 32)
    wide(rays) ++ wide(hits) ++ Seq(BigInt(count), mode) ++ ofFan ++ Seq(BigInt(0), tag) ++ wide(done) ++ wide(0)
  }
}

/** A small scene among an application's rays, and batches of rays to it. */
final class BatchStimulus(config: ColonnadeConfig, random: Random) {
  private val numbers = config.numbers

  val scene: SmallScene = new SmallScene(config, seed = 3, wide = 8, high = 8, triangleCount = 15, shadows = false)

  /** The cube's edge and corner in the application's unit: 2.5 · 2^vertexBits vertex units in one. */
  private val edge   = 0.4
  private val corner = Seq(0.25, -1.5, 7.0)
  val placed: Placed = {
    val exponent = numbers.vertexBits + 2
    Placed(
      BigInt(5) << 21,
      exponent,
      corner.map(at => BigInt(math.round(at * math.pow(2, numbers.gridFraction + exponent + 3.0))))
    )
  }

  /** What the model's query `image` has before the records. */
  def image: Seq[BigInt] = {
    val registers = scene.registers
    val bounds    = Seq("low", "high").flatMap(side => "xyz".map(axis => registers(s"bounds.$side.$axis")))
    bounds ++ placed.scale ++ placed.base
  }

  def batch(count: Int, response: Int, isFan: Boolean): TestBatch = {
    val isLocal = random.nextInt(3) == 0
    val flags   = Seq(
      4  -> isFan,
      8  -> (random.nextInt(4) == 0),
      9  -> (random.nextInt(4) == 0),
      10 -> (random.nextInt(3) == 0),
      11 -> isLocal
    )
    val mode  = (BigInt(255) << 24) + response + flags.collect { case (bit, true) => BigInt(1) << bit }.sum
    val fan   = random.nextInt(2) -> origin()
    val ofFan = (fan._2.map(_ + 0.0) :+ fan._1 * edge / 2).map(word)
    val rays  = Seq.fill(count) {
      val from   = if (isFan) fan._2 else origin()
      val target = corner.map(_ + edge * (0.2 + 0.6 * random.nextDouble()))
      val length = math.pow(2, random.nextInt(9) - 4)
      val dir    = target.zip(from).map { case (to, at) => (to - at) * length }
      val limits = Seq.fill(2)(2 * random.nextDouble() / length).sorted
      val tNear  = if (random.nextBoolean()) 0 else limits.head
      val tFar   = if (random.nextBoolean()) Double.PositiveInfinity else limits.last
      val words  = (from.zip(corner).map { case (at, low) => if (isLocal) at - low else at } :+ tNear) ++ dir :+ tFar
      val ray    = words.map(word).map(each => if (random.nextInt(200) == 0) BigInt(32, random) else each)
      if (isFan) ray.drop(4) else ray
    }
    TestBatch(
      mode,
      count,
      if (isLocal) fan._2.zip(corner).map { case (at, low) => word(at - low) } :+ ofFan.last else ofFan,
      rays.flatten
    )
  }

  /** In the cube, near it, or out of range. */
  private def origin(): Seq[Double] = {
    val reach = Seq(1.0, 1.0, 4.0, 40.0)(random.nextInt(4))
    corner.map(_ + edge * (0.5 + reach * (random.nextDouble() - 0.5)))
  }

  private def word(value: Double): BigInt = BigInt(floatToRawIntBits(value.toFloat)) & 0xffffffffL
}
