package colonnade.query

import java.lang.Float.floatToRawIntBits

import colonnade.config.ColonnadeConfig
import colonnade.unit.SmallScene

import scala.util.Random

/** A batch: its mode, its words of rays or of a sensor, and what these share: origin, tNear and tFar. */
final case class TestBatch(mode: BigInt, count: Int, shared: Seq[BigInt], rays: Seq[BigInt]) {
  val response: Int = (mode & 3).toInt
  def hitBytes: Int = response match {
    case 0 => 16 * count
    case 1 => 8 * count
    case _ => (count + 63) / 64 * 8
  }
  def query: Seq[BigInt] = Seq(mode, BigInt(count)) ++ shared ++ rays

  /** The descriptor's words. */
  def words(rays: BigInt, hits: BigInt, tag: BigInt, done: BigInt): Seq[BigInt] = {
    def wide(value: BigInt) = Seq(value & 0xffffffffL, value >> 32)
    wide(rays) ++ wide(hits) ++ Seq(BigInt(count), mode) ++ shared ++ Seq(tag) ++ wide(done) ++ wide(0)
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

  /** @param form 0: rays, 1: a fan, 2: a sensor */
  def batch(count: Int, response: Int, form: Int): TestBatch = {
    val isLocal = random.nextInt(3) == 0
    val flags   = Seq(
      4  -> (form == 1),
      5  -> (form == 2),
      8  -> (random.nextInt(4) == 0),
      9  -> (random.nextInt(4) == 0),
      10 -> (random.nextInt(3) == 0),
      11 -> isLocal
    )
    val mask   = if (random.nextBoolean()) 255 else 1 + random.nextInt(15)
    val mode   = (BigInt(mask) << 24) + response + flags.collect { case (bit, true) => BigInt(1) << bit }.sum
    val from   = origin()
    val ends   = Seq(random.nextInt(2) * edge / 2, if (random.nextInt(4) > 0) Double.PositiveInfinity else edge * 3)
    val shared = ((if (isLocal) from.zip(corner).map { case (at, low) => at - low } else from) ++ ends).map(word)
    val rays   = if (form == 2) sensor(from, if (count < 512) 64 else 128)
    else Seq.fill(count) {
      val start  = if (form == 1) from else origin()
      val target = corner.map(_ + edge * (0.2 + 0.6 * random.nextDouble()))
      val length = math.pow(2, random.nextInt(9) - 4)
      val dir    = target.zip(start).map { case (to, at) => (to - at) * length }
      val limits = Seq.fill(2)(2 * random.nextDouble() / length).sorted
      val tNear  = if (random.nextBoolean()) 0 else limits.head
      val tFar   = if (random.nextBoolean()) Double.PositiveInfinity else limits.last
      val words  = (start.zip(corner).map { case (at, low) => if (isLocal) at - low else at } :+ tNear) ++ dir :+ tFar
      val ray    = words.map(word).map(each => if (random.nextInt(200) == 0) BigInt(32, random) else each)
      if (form == 1) ray.drop(4) else ray
    }.flatten
    TestBatch(mode, count, shared, rays)
  }

  /** The same, of rays that all enter the cube, but for some that are refused or begin out of range. */
  def aimed(count: Int, response: Int, form: Int): TestBatch = {
    val batch   = this.batch(1, response, 0)
    val isLocal = batch.mode.testBit(11)
    def aim()   = {
      val reach = Seq(1.0, 4.0, 4.0, if (form == 0) 40.0 else 4.0)(random.nextInt(4))
      val from  = corner.map(_ + edge * (0.5 + reach * (random.nextDouble() - 0.5)))
      (from, corner.zip(from).map { case (low, at) => low + edge * (0.3 + 0.4 * random.nextDouble()) - at })
    }
    def placed(at: Seq[Double]) = if (isLocal) at.zip(corner).map { case (at, low) => at - low } else at
    val (from, look)            = aim()
    val scale                   = math.pow(2, 29) / look.map(_.abs).max
    val rays                    = form match {
      case 0 => Seq.fill(count) {
          val (from, to) = aim()
          (placed(from) :+ 0.0) ++ (if (random.nextInt(20) == 0) Seq(0.0, 0.0, 0.0) else to) :+ Double.PositiveInfinity
        }.flatten.map(word)
      case 1 =>
        Seq.fill(count)(look.map(_ * (1 + 0.02 * random.nextDouble())) :+ Double.PositiveInfinity).flatten.map(word)
      case _ =>
        val steps = Seq.fill(2)(Seq.fill(3)(edge / 2000 * (random.nextDouble() - 0.5)))
        (look +: steps).flatten.map(value => BigInt(math.round(value * scale)) & 0xffffffffL)
    }
    val shared = (placed(from) ++ Seq(0.0, Double.PositiveInfinity)).map(word)
    batch.copy(mode = batch.mode + (if (form == 0) 0 else 8 << form), count = count, shared = shared, rays = rays)
  }

  /** Words of a sensor that looks at the cube: directions of any length, down to those of a few digits. */
  private def sensor(from: Seq[Double], width: Int): Seq[BigInt] = {
    val scale                        = math.pow(2, random.nextInt(30))
    val look                         = from.zip(corner).map { case (at, low) => low + edge / 2 - at }
    val far                          = look.map(_.abs).max.max(edge)
    def units(value: Double): BigInt = BigInt(math.round(value / far * scale)) & 0xffffffffL
    val Seq(right, down)             = Seq.fill(2)(Seq.fill(3)(edge / 40 * (random.nextDouble() - 0.5)))
    val first                        = look.zip(right).map { case (at, step) => at - 32 * step }
    Seq(first, right, down).flatMap(_.map(units)) ++ (BigInt(width) +: Seq.fill(6)(BigInt(0)))
  }

  /** In the cube, near it, or out of range. */
  private def origin(): Seq[Double] = {
    val reach = Seq(1.0, 1.0, 4.0, 40.0)(random.nextInt(4))
    corner.map(_ + edge * (0.5 + reach * (random.nextDouble() - 0.5)))
  }

  private def word(value: Double): BigInt = BigInt(floatToRawIntBits(value.toFloat)) & 0xffffffffL
}
