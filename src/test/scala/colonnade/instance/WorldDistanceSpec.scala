package colonnade.instance

import chisel3._
import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.numbers.Fixed
import colonnade.ray.RayFormats
import colonnade.{Packed, PackedStreams, PackedUnit, Simulation}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

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
