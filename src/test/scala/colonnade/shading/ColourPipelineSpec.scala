package colonnade.shading

import chisel3._
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.{Always, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** The unit, and the pipeline. */
private class ColourHarness(config: ColonnadeConfig) extends Module {
  val units = IO(Vec(2, new ColourUnitIO(config)))
  units.head <> Module(new ColourUnit(config)).io
  units.last <> Module(new ColourPipeline(config)).io
}

class ColourPipelineSpec extends AnyFlatSpec with ChiselScalatestTester {
  import ColourEvent._

  behavior of "ColourPipeline"

  for {
    (lights, maxBounces, hasEnvironment) <- Seq((1, 2, true), (3, 15, true), (1, 2, false), (2, 0, true))
  } {
    val base   = if (hasEnvironment) TestConfigs.withEnvironment(TestConfigs.environment) else TestConfigs.tiny
    val config = base.copy(
      array = base.array.copy(contexts = 16),
      frame = base.frame.copy(lights = lights, maxBounces = maxBounces, emission = lights == 3)
    )
    val where = if (hasEnvironment) " in an environment" else ""
    it should s"give the colours of ColourUnit with $lights lights and $maxBounces bounces$where" taggedAs Always.unless(
      maxBounces == 0 || !hasEnvironment
    ) in
      test(new ColourHarness(config)).withAnnotations(Simulation.verilator) { dut =>
        val random = new Random(lights)
        val script = new ColourScript(config, random)
        val units  = dut.units.map(new ColourDriver(_, config))
        dut.clock.setTimeout(0)

        /** Plays the events of each context on both units; the pipeline's cycles to its last colour. */
        def play(events: Seq[Seq[ColourEvent]], stalls: Double): Int = {
          units.foreach(_.enqueue(events))
          var cycles = 0
          var least  = 0
          while (units.exists(!_.isDone)) {
            units.foreach(_.act(random, stalls))
            cycles += 1
            if (!units.last.isDone) least = cycles
            dut.clock.step()
            assert(cycles < 40000, "no end")
          }
          for ((expected, colours) <- units.head.colours.zip(units.last.colours); pair <- expected.zip(colours))
            assert(pair._1 == pair._2)
          least
        }

        for (round <- 0 until 4) {
          val values = script.registers()
          script.lights = if (round < 3) lights - round.min(lights) else lights
          units.foreach(_.registers(values, script.lights))
          play(Seq.fill(config.array.contexts)(Seq.fill(12)(script.path()).flatten), Seq(0.0, 0.3, 0.9)(round % 3))
        }

        // Throughput: one shadowed pixel does not delay the others
        val contexts = config.array.contexts
        val seen     = script.surface()

        def cycles(name: String, most: Int)(event: Int => ColourEvent): Unit = {
          play(Seq.fill(contexts)(Seq(Start, Remember(seen))), 0)
          val each = play(Seq.tabulate(contexts)(context => Seq(event(context))), 0).toDouble / contexts
          info(f"$name: $each%.1f cycles")
          assert(each <= most + 0.7)
          if (name.contains("bounce")) play(Seq.fill(contexts)(Seq(End(true, seen.direct.map(_ => 0), false))), 0)
        }
        val none   = seen.direct.map(_ => 0)
        val opaque = seen.direct.map(_ => 2)
        cycles("an end at a surface", 3 * lights)(_ => End(false, none, isDirectView = true))
        cycles("an end in the background", 3)(_ => End(true, none, isDirectView = false))
        cycles("an end where one is shadowed", 3 * lights + 1)(context =>
          End(false, if (context == 0) opaque else none, isDirectView = true)
        )
        if (maxBounces > 0) {
          cycles("a bounce", 3)(_ => Bounce(Seq.fill(3)(1000), isTinted = true, 99, hasSurface = false))
          cycles("a first bounce without a Fresnel reflection", 1)(_ =>
            Bounce(Seq.fill(3)(1000), isTinted = true, 0, hasSurface = false)
          )
          if (hasEnvironment)
            cycles("a bounce at a surface", 3 + 3 * lights)(_ =>
              Bounce(Seq.fill(3)(9), isTinted = true, 99, hasSurface = true)
            )
        }
      }
  }
}
