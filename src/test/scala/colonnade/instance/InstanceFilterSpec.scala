package colonnade.instance

import chisel3._
import chisel3.util.RegEnable
import chiseltest._
import colonnade.TestParts._
import colonnade.config.{ColonnadeConfig, PathConfig}
import colonnade.formats.ObjectBox
import colonnade.ray.PreparedRay
import colonnade.{Model, Packed, PackedStreams, PackedUnit, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

private class InstanceFilterHarness(config: ColonnadeConfig)
    extends PackedUnit(new PreparedRay(PathConfig(config)), new EnteredBoxes(config)) {
  private val filter = Module(new InstanceFilter(config)).io

  val count = IO(Input(chiselTypeOf(filter.count)))
  val boxes = IO(Input(UInt(filter.boxes.getWidth.W)))
  filter.count := count
  filter.boxes := RegEnable(boxes, true.B).asTypeOf(filter.boxes)
  connect(filter.ray, filter.entered)
}

/** The instances whose boxes a ray may enter are the model's, bit for bit. */
class InstanceFilterSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "InstanceFilter"

  for ((format, instances) <- InstanceStimulus.formats.zip(Seq(16, 3, 6))) {
    val config = TestConfigs.withInstances(format, instances)
    it should s"equal the model under random stalls, $instances instances, ${config.precision}" in
      test(new InstanceFilterHarness(config)).withAnnotations(Simulation.verilator) { dut =>
        val random   = new Random(instances)
        val stimulus = new InstanceStimulus(config, random)
        val input    = new Packed(new PreparedRay(PathConfig(config)))
        val output   = new Packed(new EnteredBoxes(config))
        val boxBits  = new Packed(Vec(instances, new ObjectBox))
        var entered  = 0
        for (count <- Seq(1, instances / 2, instances)) {
          val boxes = Seq.fill(instances)(stimulus.box())
          dut.count.poke(count)
          dut.boxes.poke(boxBits.pack(boxes.zipWithIndex.flatMap { case ((low, high), i) =>
            low.zip(high).zip("xyz").flatMap { case ((from, to), axis) =>
              Seq(s"[$i].low.$axis" -> from, s"[$i].high.$axis" -> to)
            }
          }.toMap))
          dut.clock.step()
          val rays =
            Seq.fill(200)((stimulus.ray(), if (random.nextInt(4) == 0) stimulus.distance() else stimulus.farthest))
          val payloads = rays.zipWithIndex.map { case ((ray, tMax), i) =>
            input.pack(ray.fields("ray") ++ Map(
              "context"  -> BigInt(i % 5),
              "isShadow" -> BigInt(i % 2),
              "tMax"     -> tMax
            ))
          }
          val requests = for ((ray, tMax) <- rays; (low, high) <- boxes.take(count))
            yield (ray.numbers :+ tMax) ++ low ++ high
          val expected   = Model.answers(config, requests, "instancebox").map(_.head.toInt).grouped(count).toSeq
          val (found, _) = PackedStreams.run(dut, payloads, 0.5, 0.4, random)
          for ((((bits, enters), (ray, tMax)), i) <- found.zip(expected).zip(rays).zipWithIndex)
            withClue(s"$ray before $tMax: ") {
              val result = output.unpack(bits)
              Seq("context", "isShadow", "tMax").map(result(_)) shouldBe Seq(BigInt(i % 5), BigInt(i % 2), tMax)
              (0 until instances).map(result("mask").testBit(_)) shouldBe enters.map(_ == 1).padTo(instances, false)
            }
          entered += expected.flatten.sum
          val cycles = PackedStreams.run(dut, payloads)._2
          cycles should be <= payloads.size * ((count + 7) / 8) + 5
        }
        entered should be > 30
      }
  }
}
