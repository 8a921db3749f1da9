package colonnade.instance

import chisel3._
import chisel3.util.RegEnable
import chiseltest._
import colonnade.TestParts._
import colonnade.config.{ColonnadeConfig, PathConfig}
import colonnade.formats.ObjectInstance
import colonnade.{Packed, PackedStreams, PackedUnit, Simulation}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

/** A ray with its instance. */
private final class TransformInput(config: PathConfig) extends Bundle {
  val visit    = new InstanceVisit(config)
  val instance = new ObjectInstance(config.device)
}

private class InstanceTransformHarness(config: ColonnadeConfig)
    extends PackedUnit(new TransformInput(config), new ObjectRay(config)) {
  private val transform = Module(new InstanceTransform(config)).io
  private val input     = in.bits.asTypeOf(new TransformInput(config))
  transform.visit.valid := in.fire
  transform.visit.bits  := input.visit
  in.ready              := RegNext(transform.readyNext, false.B)
  for ((instance, number) <- transform.instances.zipWithIndex) {
    val comes = in.fire && input.visit.instance === number.U
    instance := Mux(comes, input.instance, RegEnable(input.instance, comes))
  }
  out.valid           := transform.ray.valid
  out.bits            := transform.ray.bits.asUInt
  transform.ray.ready := out.ready
}

/** Rays in the axes of objects equal the model's, bit for bit. */
class InstanceTransformSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "InstanceTransform"

  for (config <- InstanceStimulus.formats)
    it should s"equal the model under random stalls, ${config.precision}" in
      test(new InstanceTransformHarness(config)).withAnnotations(Simulation.verilator) { dut =>
        val random   = new Random(5)
        val stimulus = new InstanceStimulus(config, random)
        val cases    = stimulus.cases(300)
        val input    = new Packed(new TransformInput(config))
        val output   = new Packed(new ObjectRay(config))
        val payloads = cases.zipWithIndex.map { case (each, i) =>
          input.pack(each.ray.fields("visit.ray") ++ each.transform.fields("instance") ++
            Map("visit.context" -> BigInt(i % 5), "visit.isShadow" -> BigInt(i % 2), "visit.tMax" -> each.tMax) +
            ("visit.instance" -> BigInt(i % 3)))
        }
        val (rays, _) = PackedStreams.run(dut, payloads, 0.5, 0.4, random)
        for ((((bits, each), expected), i) <- rays.zip(cases).zip(stimulus.answers(cases)).zipWithIndex)
          withClue(s"$each: ") {
            val ray = output.unpack(bits)
            Seq("x", "y", "z").map(axis => ray(s"request.origin.$axis")) shouldBe expected.origin
            Seq("x", "y", "z").map(axis => ray(s"request.dir.$axis")) shouldBe expected.dir
            Seq(
              "request.visit.bits.tMax",
              "scale.length.mantissa",
              "scale.length.exponent",
              "scale.shift"
            ).map(ray(_)) shouldBe
              Seq(expected.limit, expected.mantissa, expected.exponent, BigInt(each.transform.shift))
            Seq("context", "isShadow", "visit.valid", "visit.bits.instance").map(name => ray(s"request.$name")) shouldBe
              Seq(i % 5, i % 2, 1, i % 3).map(BigInt(_))
          }
        val interval = PackedStreams.run(dut, payloads)._2 / payloads.size
        info(s"$interval cycles a ray")
        interval should be <= 3
      }
}
