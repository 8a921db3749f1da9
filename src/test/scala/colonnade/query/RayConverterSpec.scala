package colonnade.query

import chisel3._
import chiseltest._
import colonnade.{Packed, PackedStreams, PackedUnit, Simulation}
import colonnade.config.ColonnadeConfig
import colonnade.formats.RayPlacement
import colonnade.TestParts._
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import java.lang.Float.{floatToRawIntBits, intBitsToFloat}
import scala.util.Random

private class RayConverterHarness(config: ColonnadeConfig)
    extends PackedUnit(new BatchRay(config), new ConvertedRay(config)) {
  private val converter = Module(new RayConverter(config)).io

  val placement = IO(Input(UInt((new RayPlacement).getWidth.W)))
  converter.placement := placement.asTypeOf(new RayPlacement)
  connect(converter.rays, converter.converted)
}

/** Rays of floats equal the model's, bit for bit, over all exponents. */
class RayConverterSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "RayConverter"

  for (config <- RayConfigs.formats)
    it should s"equal the model under random stalls, ${RayConfigs.nameOf(config)}" in
      test(new RayConverterHarness(config)).withAnnotations(Simulation.verilator) { dut =>
        val random    = new Random(5)
        val stimulus  = new RayStimulus(config, random)
        val ray       = new Packed(new BatchRay(config))
        val converted = new Packed(new ConvertedRay(config))
        val kinds     = for (round <- 0 until 24) yield {
          val placed  = stimulus.placement()
          val isLocal = round % 3 == 0
          val records =
            Seq.fill(20)(stimulus.ray(placed, isLocal)) ++ Seq.fill(10)(stimulus.anyLimits()) :+ stimulus.anyRay()
          val queries  = records.map(placed.scale ++ placed.base ++ Seq(BigInt(if (isLocal) 1 else 0)) ++ _)
          val expected = RayConfigs.model(config, "ray", queries)
          dut.placement.poke(placed.packed)
          val payloads = records.zipWithIndex.map { case (record, i) =>
            ray.pack(Map("context" -> BigInt(i % 4), "isLocal" -> BigInt(if (isLocal) 1 else 0))) + recordOf(record)
          }
          val (results, _) = PackedStreams.run(dut, payloads, 0.7, 0.6, random)
          for (((result, reply), record) <- results.map(converted.unpack).zip(expected).zip(records))
            withClue(s"$placed, ${record.map(_.toString(16))}: ") {
              kindOf(result) shouldBe reply.head
              val request = Seq("limits.tMin", "limits.tMax") ++ Seq("origin", "dir").flatMap(name =>
                "xyz".map(axis => s"$name.$axis")
              )
              if (reply.head == 0) request.map(name => result(s"request.$name")) shouldBe reply.tail
              else "xyz".map(axis => result(s"request.dir.$axis")).toSet shouldBe Set(BigInt(0))
            }
          expected.map(_.head.toInt)
        }
        val counts = kinds.flatten.groupBy(identity).map { case (kind, all) => kind -> all.size }
        info(s"legal, refused, out of range: ${counts.toSeq.sorted.map(_._2).mkString(", ")}")
        counts.keySet shouldBe Set(0, 1, 2)
        counts.values.min should be > 20
      }

  private def recordOf(words: Seq[BigInt]): BigInt =
    words.zipWithIndex.map { case (word, i) => word << (32 * i) }.sum // the record has the lowest bits

  private def kindOf(result: Map[String, BigInt]): BigInt =
    if (result("isRefused") == 1) 1 else 2 * result("scale.isOutOfRange")
}

/** Where a scene lies, as [[colonnade.formats.RayPlacement]]. */
final case class Placed(mantissa: BigInt, exponent: Int, base: Seq[BigInt]) {
  def scale: Seq[BigInt] = Seq(mantissa, BigInt(exponent))

  def packed: BigInt = new Packed(new RayPlacement).pack(
    Map("mantissa" -> mantissa, "exponent" -> BigInt(exponent)) ++
      "xyz".zip(base).map { case (axis, value) => s"base.$axis" -> value }
  )
}

/** Rays of applications as words of memory: origin, tNear, direction, tFar. */
final class RayStimulus(config: ColonnadeConfig, random: Random) {
  private val numbers = config.numbers

  /** A scene with units of any size, up to as far from the origin as a float distinguishes them. */
  def placement(): Placed = {
    val exponent = random.nextInt(241) - 120
    val far      = random.nextInt(62)
    Placed(
      (BigInt(1) << 23) + BigInt(23, random),
      exponent,
      Seq.fill(3)(if (far < 8) BigInt(0) else BigInt(far, random) - (BigInt(1) << far) / 2)
    )
  }

  /** About the scene, with any number in any place now and then. */
  def ray(placed: Placed, isLocal: Boolean): Seq[BigInt] = {
    val unit   = math.pow(2, 24.0 - placed.exponent) / placed.mantissa.toDouble
    val steps  = math.pow(2, -numbers.gridFraction - placed.exponent - 3.0)
    val edge   = unit * math.pow(2, numbers.vertexBits)
    val reach  = Seq(1.0, 4.0, 17.0)(random.nextInt(3))
    val origin = placed.base.map(base =>
      (if (isLocal) 0 else base.toDouble * steps) + edge * reach * (2 * random.nextDouble() - 1)
    )
    val length = math.pow(2, random.nextInt(21) - 10)
    val dir    = Seq.fill(3)(random.nextInt(8) match {
      case 0 => 0.0
      case 1 => length
      case _ => length * random.nextGaussian()
    })
    val limits = Seq.fill(2)(edge * 20 * random.nextDouble() / length).sorted
    val tNear  = if (random.nextBoolean()) 0.0 else limits.head
    val tFar   = if (random.nextBoolean()) Double.PositiveInfinity else limits.last
    val ray    = (origin :+ tNear) ++ dir :+ tFar
    ray.map(value => if (random.nextInt(40) == 0) any() else wordOf(value.toFloat))
  }

  /** Of any exponent, subnormal, infinite, or not a number. */
  def any(): BigInt = {
    val fraction = random.nextInt(4) match {
      case 0 => 0
      case 1 => 0x7fffff
      case _ => random.nextInt(1 << 23)
    }
    wordOf(intBitsToFloat(random.nextInt(2) << 31 | random.nextInt(256) << 23 | fraction))
  }

  def anyRay(): Seq[BigInt] = Seq.fill(8)(any())

  /** Legal but for its positions: limits and direction of any exponents. */
  def anyLimits(): Seq[BigInt] = {
    val magnitudes = Seq.fill(2)(any() & 0x7fffffff).sorted
    (Seq.fill(3)(BigInt(0)) :+ magnitudes.head) ++ Seq.fill(3)(any()) :+ magnitudes.last
  }

  private def wordOf(value: Float): BigInt = BigInt(floatToRawIntBits(value)) & 0xffffffffL
}
