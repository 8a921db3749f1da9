package colonnade.shading

import chiseltest._
import colonnade.{Always, Simulation, TestConfigs}
import colonnade.config.ColonnadeConfig
import colonnade.TestParts._
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** A path's colour is that of its last surface, weighted by its throughput, whatever other paths do meanwhile. */
class ColourUnitSpec extends AnyFlatSpec with ChiselScalatestTester {
  import ColourEvent._

  behavior of "ColourUnit"

  for {
    (lights, maxBounces, hasEnvironment) <- Seq((1, 2, true), (3, 15, true), (1, 2, false), (2, 0, true))
    gather                               <- if (lights == 3 || !hasEnvironment) Seq(true) else Seq(false)
  } {
    val base  = if (hasEnvironment) TestConfigs.withEnvironment(TestConfigs.environment) else TestConfigs.tiny
    val sized = base.copy(
      units = base.units.copy(pathContexts = 16),
      frame = base.frame.copy(lights = lights, maxBounces = maxBounces, emission = lights == 3)
    )
    val config = if (gather) TestConfigs.gathering(sized) else sized
    val where  = (if (gather) " that gather" else "") + (if (hasEnvironment) " in an environment" else "")
    it should s"colour paths with $lights lights and $maxBounces bounces$where" taggedAs Always.unless(
      maxBounces == 0 || !hasEnvironment
    ) in
      test(new ColourUnit(config)).withAnnotations(Simulation.verilator) { dut =>
        val random = new Random(lights)
        val script = new ColourScript(config, random)
        val driver = new ColourDriver(dut.io, config)
        // By context, and those of the paths that have ended
        var events  = Seq.fill(config.units.pathContexts)(Seq.empty[ColourEvent])
        var values  = script.registers()
        var checked = 0
        dut.clock.setTimeout(0)

        /** Plays the events of each context; the cycles to the last colour. */
        def play(more: Seq[Seq[ColourEvent]], stalls: Double): Int = {
          driver.enqueue(more)
          events = events.zip(more).map { case (before, more) => before ++ more }
          var cycles = 0
          while (!driver.isDone) {
            driver.act(random, stalls)
            cycles += 1
            dut.clock.step()
            assert(cycles < 40000, "no end")
          }
          val reference = new ColourReference(config, values._1, values._2, values._3)
          for ((events, colours) <- events.zip(driver.colours)) {
            val expected = reference.colours(events)
            assert(colours.toSeq == expected.takeRight(colours.size))
            checked += colours.size
            colours.clear()
          }
          cycles
        }

        for (round <- 0 until 4) {
          values = script.registers()
          script.lights = if (round < 3) lights - round.min(lights) else lights
          driver.registers(values, script.lights)
          events = events.map(_ => Nil)
          play(Seq.fill(config.units.pathContexts)(Seq.fill(6)(script.path()).flatten), Seq(0.0, 0.3, 0.9)(round % 3))
        }

        assert(checked == 4 * 6 * config.units.pathContexts)

        // Throughput: one shadowed pixel does not delay the others
        val contexts = config.units.pathContexts
        val seen     = script.surface()

        def cycles(name: String, most: Int)(event: Int => ColourEvent): Unit = {
          play(Seq.fill(contexts)(Seq(Start, Remember(seen))), 0)
          val each = play(Seq.tabulate(contexts)(context => Seq(event(context))), 0).toDouble / contexts
          info(f"$name: $each%.1f cycles")
          assert(each <= most + 0.7)
          if (name.contains("bounce"))
            play(Seq.fill(contexts)(Seq(End(true, seen.direct.map(_ => 0), isDirectView = false))), 0)
        }
        val none   = seen.direct.map(_ => 0)
        val opaque = seen.direct.map(_ => 2)
        cycles("an end at a surface", 3 * lights)(_ =>
          End(false, none, isDirectView = hasEnvironment)
        )
        cycles("an end in the background", 3)(_ => End(true, none, isDirectView = false))
        cycles("an end where one is shadowed", 3 * lights + 1)(context =>
          End(false, if (context == 0) opaque else none, isDirectView = hasEnvironment)
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

/** The colours of paths in the integers of docs/numbers.md, sections 5.9 and 6.7.
  *
  * @param shadowTransmittance of the light that transmissive triangles leave, of 4096
  */
final class ColourReference(
    config:              ColonnadeConfig,
    ambient:             Seq[Int],
    background:          Seq[Int],
    shadowTransmittance: Int
) {
  import ColourEvent._

  private type Xyz = Seq[Int]

  private val one   = 4096
  private val white = 4095

  /** Colours of the paths of one context, and the shadow ratios of those that have one. Paths end before the last
    * event.
    */
  def colours(events: Seq[ColourEvent]): Seq[(Xyz, Option[Xyz])] = {
    var throughput, radiance           = Seq.empty[Int]
    var surface                        = Option.empty[LitColours]
    var gathered                       = Seq.empty[Int]
    def add(part: Xyz, seen: Xyz): Xyz =
      Seq(radiance, part, seen).transpose.map { case Seq(sure, part, seen) =>
        white.min(sure + (part.toLong * seen >> 12).toInt)
      }
    events.flatMap {
      case Start =>
        throughput = Seq.fill(3)(one)
        radiance = Seq.fill(3)(0)
        None
      case Remember(what) =>
        surface = Some(what)
        None
      case Bounce(albedo, isTinted, fresnel, hasSurface, light) =>
        val tinted = throughput.zip(albedo).map { case (weight, tint) =>
          if (isTinted) weight * (tint + (tint >> 11)) >> 12 else weight
        }
        val parts = tinted.map(_ * fresnel >> 12)
        val seen  =
          if (hasSurface) leaving(surface.get, unshadowed(surface.get)) else light.getOrElse(background)
        radiance = add(parts, seen)
        throughput = tinted.zip(parts).map { case (weight, part) => weight - part }
        None
      case Gather(occlusions) =>
        val what  = surface.get
        val light = visible(what, occlusions).zip(ambient).map { case (all, ambient) => all - ambient }
        radiance = add(throughput, leaving(what, light))
        throughput = throughput.zip(what.albedo).map { case (weight, tint) => weight * (tint + (tint >> 11)) >> 12 }
        None
      case EndInCube(light)                     => Some(add(throughput, light) -> None)
      case End(true, _, _)                      => Some(add(throughput, background) -> None)
      case End(false, occlusions, isDirectView) =>
        val what  = surface.get
        val light = visible(what, occlusions)
        Some(add(throughput, leaving(what, light)) -> Option.when(isDirectView)(ratio(light, unshadowed(what))))
      case GoBack(light, occlusions) =>
        gathered =
          light.map(add(throughput, _)).getOrElse(add(
            throughput,
            leaving(surface.get, visible(surface.get, occlusions))
          ))
        None
      case EndWithGathered(occlusions) =>
        val light = Seq(visible(surface.get, occlusions), gathered, ambient).transpose.map {
          case Seq(all, gathered, ambient) =>
            all - ambient + gathered
        }
        Some(leaving(surface.get, light) -> Some(ratio(light, unshadowed(surface.get))))
    }
  }

  /** Less than 2; 1 for 0 / 0. */
  private def ratio(part: Xyz, whole: Xyz): Xyz = part.zip(whole).map { case (part, whole) =>
    if (part == whole) one else if (part < 2 * whole) (part.toLong * one / whole).toInt else 2 * one - 1
  }

  private def unshadowed(surface: LitColours): Xyz = visible(surface, surface.direct.map(_ => 0))

  private def visible(surface: LitColours, occlusions: Seq[Int]): Xyz = ambient.indices.map { channel =>
    ambient(channel) + surface.direct.zip(occlusions).map { case (direct, occlusion) =>
      val share = Seq(one, shadowTransmittance, 0)(occlusion)
      (direct(channel).toLong * share >> 12).toInt
    }.sum
  }

  /** What a surface reflects of the light, and emits. */
  private def leaving(surface: LitColours, light: Xyz): Xyz =
    Seq(surface.albedo, light, surface.emission).transpose.map { case Seq(albedo, light, emission) =>
      val reflected = (albedo.toLong * light >> 12).min(white).toInt
      if (config.frame.emission) (reflected + emission).min(white) else reflected
    }
}
