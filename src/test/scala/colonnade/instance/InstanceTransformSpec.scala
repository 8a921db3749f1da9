package colonnade.instance

import chisel3._
import chisel3.util.RegEnable
import chiseltest._
import colonnade.{Packed, PackedStreams, PackedUnit, Simulation}
import colonnade.config.{ColonnadeConfig, PathConfig}
import colonnade.formats.ObjectInstance
import colonnade.numbers.Fixed
import colonnade.ray.RayFormats
import colonnade.TestParts._
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
  transform.visit.valid := in.valid
  transform.visit.bits  := input.visit
  in.ready              := transform.visit.ready
  for ((instance, number) <- transform.instances.zipWithIndex) {
    val comes = in.valid && input.visit.instance === number.U
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
        interval shouldBe 1
      }
}

private class WorldDistanceHarness(config: ColonnadeConfig)
    extends PackedUnit(new ObjectDistance(config), new Fixed(new RayFormats(config.numbers).grid)) {
  private val unit = Module(new WorldDistance(config)).io
  unit.distance.valid := in.valid
  unit.distance.bits  := in.bits.asTypeOf(unit.distance.bits)
  in.ready            := true.B
  out.valid           := unit.t.valid
  out.bits            := unit.t.bits.asUInt
  assert(!unit.t.valid || out.ready)
}

/** Distances along the ray of the world equal the model's, bit for bit; those out of range are the largest. */
class WorldDistanceSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "WorldDistance"

  for (config <- InstanceStimulus.formats)
    it should s"equal the model, ${config.precision}" in
      test(new WorldDistanceHarness(config)).withAnnotations(Simulation.verilator) { dut =>
        val random   = new Random(9)
        val stimulus = new InstanceStimulus(config, random)
        val cases    = stimulus.cases(900)
        val entered  = cases.zip(stimulus.answers(cases)).filter(_._2.entry.nonEmpty)
        val input    = new Packed(new ObjectDistance(config))
        val payloads = entered.map { case (each, expected) =>
          input.pack(Map(
            "tEntry"                -> expected.entry.get._1,
            "t"                     -> each.beyond,
            "scale.length.mantissa" -> expected.mantissa,
            "scale.length.exponent" -> expected.exponent,
            "scale.shift"           -> BigInt(each.transform.shift)
          ))
        }
        val (found, _) = PackedStreams.run(dut, payloads, 0.5, 1, random)
        for ((t, (each, expected)) <- found.zip(entered))
          withClue(s"$each: ")(t shouldBe expected.entry.get._2)
        val interval = PackedStreams.run(dut, payloads)._2 / payloads.size
        info(s"$interval cycles a hit")
        interval shouldBe 1
        found.size should be > 300
        found.distinct.size should be > 200
      }
}
