package colonnade.query

import chisel3._
import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.formats.RayPlacement
import colonnade.{Packed, PackedStreams, PackedUnit, Simulation}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

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
