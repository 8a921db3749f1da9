package colonnade.shading

import chisel3._
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.Rgb
import colonnade.numbers.Fixed
import colonnade.numbers.FixedPorts._
import colonnade.{Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** A path's colour is that of its last surface, weighted by its throughput, whatever other paths do meanwhile. */
class ColourUnitSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "ColourUnit"

  for {
    (base, where) <-
      Seq(TestConfigs.tiny -> "", TestConfigs.withEnvironment(TestConfigs.environment) -> " in an environment")
    (lights, maxBounces) <- Seq((1, 0), (2, 0), (1, 2), (3, 15))
  } {
    val config = base.copy(frame = base.frame.copy(lights = lights, maxBounces = maxBounces, emission = lights > 1))
    val what   = if (config.frame.emission) "emissive paths" else "paths"
    it should s"colour $what with $lights lights and $maxBounces bounces$where" in
      test(new ColourUnit(config)).withAnnotations(Simulation.verilator) { dut =>
        new ColouredPaths(dut, config, seed = lights).run(paths = 60)
      }
  }
}

/** Paths of all contexts at a time, in the integers of docs/numbers.md, sections 5.9 and 6.7. */
private class ColouredPaths(dut: ColourUnit, config: ColonnadeConfig, seed: Int) {
  private val random   = new Random(seed)
  private val contexts = config.array.contexts
  private val one      = 4096
  private val white    = 4095

  private def xyz(value: => Int): Seq[Int] = Seq.fill(3)(value)

  private def colour(): Seq[Int] =
    xyz(if (random.nextInt(4) == 0) random.nextInt(2) * white else random.nextInt(4096))

  private def intensity(): Seq[Int] =
    xyz(if (random.nextInt(6) == 0) 65535 else random.nextInt(6) * random.nextInt(1800))

  private val ambient             = intensity()
  private val background          = colour()
  private val shadowTransmittance = random.nextInt(one + 1)

  private var throughput = Seq.fill(contexts)(Seq.fill(3)(one))
  private var radiance   = Seq.fill(contexts)(Seq.fill(3)(0))
  private val isStraight = Array.fill(contexts)(true)

  def run(paths: Int): Unit = {
    poke(dut.io.ambient, ambient)
    pokeUInt(dut.io.background, background)
    dut.io.shading.shadowTransmittance.foreach(_.pokeRaw(shadowTransmittance))
    for (_ <- 0 until paths) {
      // Some contexts hit mirrors and glass, then all paths end, in any order
      (0 until contexts).foreach(begin)
      for (_ <- 0 until random.nextInt(8); bounce <- dut.io.bounce) pass(bounce, random.nextInt(contexts))
      random.shuffle((0 until contexts).toList).foreach(end)
    }
  }

  private def begin(context: Int): Unit = {
    isStraight(context) = true
    throughput = throughput.updated(context, Seq.fill(3)(one))
    radiance = radiance.updated(context, Seq.fill(3)(0))
  }

  /** Bounces a path. Where there is an environment, some reflections show a surface, lit by all lights. */
  private def pass(port: chisel3.util.DecoupledIO[BounceUpdate], context: Int): Unit = {
    val (albedo, isTinted, fresnel) = (colour(), random.nextBoolean(), random.nextInt(3) * random.nextInt(one / 2))
    val surface                     = Option.when(config.hasEnvironment && random.nextBoolean())(remember(context))
    val behind                      = surface.fold(background)(surface => shown(surface, surface.all))
    port.bits.context.poke(context)
    port.bits.isFirst.poke(isStraight(context))
    isStraight(context) = false
    pokeUInt(port.bits.albedo, albedo)
    port.bits.isTinted.poke(isTinted)
    port.bits.fresnel.pokeRaw(fresnel)
    port.bits.hasSurface.foreach(_.poke(surface.nonEmpty))
    offer(port)
    // Later changes of the ports have no effect
    dut.io.end.bits.occlusions.foreach(_.poke(Occlusion.opaque))
    if (random.nextBoolean()) {
      var cycles = 0
      while (!port.ready.peekBoolean()) {
        dut.clock.step()
        cycles += 1
      }
      assert(cycles == 20 + surface.fold(0)(_ => 6 * (config.frame.lights + 1)), "cycles of a bounce")
    }

    val tinted = throughput(context).zip(albedo).map { case (weight, tint) =>
      if (isTinted) weight * (tint + (tint >> 11)) >> 12 else weight
    }
    val parts = tinted.map(_ * fresnel >> 12)
    radiance = radiance.updated(
      context,
      radiance(context).zip(parts.zip(behind)).map { case (sure, (part, reflection)) =>
        white.min(sure + (part * reflection >> 12))
      }
    )
    throughput = throughput.updated(context, tinted.zip(parts).map { case (weight, part) => weight - part })
  }

  private def end(context: Int): Unit = {
    val surface      = remember(context)
    val isBackground = random.nextInt(4) == 0
    val isDirectView = random.nextBoolean()
    val kinds        = if (config.frame.hasBounces) Occlusion.all.toList else List(Occlusion.none, Occlusion.opaque)
    val met = surface.directLight.map(_ => if (random.nextInt(3) == 0) Occlusion.none else random.shuffle(kinds).head)

    dut.io.end.bits.context.poke(context)
    dut.io.end.bits.isBackground.poke(isBackground)
    dut.io.end.bits.isStraight.foreach(_.poke(isStraight(context)))
    dut.io.end.bits.isDirectView.foreach(_.poke(isDirectView))
    dut.io.end.bits.occlusions.zip(met).foreach { case (port, what) => port.poke(what) }
    offer(dut.io.end)
    var cycles = 1
    while (!dut.io.colour.valid.peekBoolean()) {
      dut.clock.step()
      cycles += 1
    }

    val visible = ambient.zipWithIndex.map { case (light, channel) =>
      light + surface.directLight.zip(met).map {
        case (direct, Occlusion.none)         => direct(channel)
        case (direct, Occlusion.transmissive) => (direct(channel).toLong * shadowTransmittance >> 12).toInt
        case _                                => 0
      }.sum
    }
    val last  = if (isBackground) background else shown(surface, visible)
    val whole = radiance(context).zip(throughput(context).zip(last)).map { case (sure, (weight, seen)) =>
      white.min(sure + (weight * seen >> 12))
    }
    dut.io.colour.bits.context.expect(context)
    assert(dut.io.colour.bits.colour.channels.map(_.peekInt().toInt) == whole)

    // The shadow ratio of a directly visible point of the environment
    val parts   = visible.zip(surface.all)
    val hasPart = config.hasEnvironment && isDirectView && !isBackground
    for (ratio <- dut.io.colour.bits.ratio if hasPart)
      assert(
        ratio.channels.map(_.raw.asUInt.peekInt().toInt) ==
          parts.map { case (part, all) => if (part == all) one else (part.toLong * one / all).toInt },
        s"of $parts"
      )
    val divisions = if (hasPart) parts.count { case (part, all) => part != all } else 0
    assert(
      cycles == (if (isBackground) 8 else 2 + 6 * (config.frame.lights + 2)) + 12 * divisions,
      "cycles from an end to its colour"
    )
  }

  /** A surface of the context. Some lights are as bright as the ambient light, which gives a ratio of exactly one half. */
  private def remember(context: Int): TestSurface = {
    val surface = TestSurface(
      colour(),
      Seq.fill(config.frame.lights)(if (random.nextInt(3) == 0) ambient else intensity()),
      if (config.frame.emission && random.nextBoolean()) colour() else xyz(0)
    )
    dut.io.surface.bits.emission.foreach(pokeUInt(_, surface.emission))
    dut.io.surface.valid.poke(true)
    dut.io.surface.bits.context.poke(context)
    pokeUInt(dut.io.surface.bits.albedo, surface.albedo)
    dut.io.surface.bits.directLight.zip(surface.directLight).foreach { case (port, direct) => poke(port, direct) }
    dut.clock.step()
    dut.io.surface.valid.poke(false)
    surface
  }

  private def offer(port: chisel3.util.DecoupledIO[_]): Unit = {
    port.valid.poke(true)
    while (!port.ready.peekBoolean()) dut.clock.step()
    dut.clock.step()
    port.valid.poke(false)
  }

  /** What a surface reflects of the light, and emits. */
  private def shown(surface: TestSurface, light: Seq[Int]): Seq[Int] =
    surface.albedo.zip(light).zip(surface.emission).map { case ((albedo, light), emission) =>
      ((albedo.toLong * light >> 12).min(white) + emission).min(white).toInt
    }

  private case class TestSurface(albedo: Seq[Int], directLight: Seq[Seq[Int]], emission: Seq[Int]) {

    /** The incoming light without shadows. */
    def all: Seq[Int] = ambient.indices.map(channel => ambient(channel) + directLight.map(_(channel)).sum)
  }

  private def poke(port: Rgb[Fixed], values: Seq[Int]): Unit =
    port.channels.zip(values).foreach { case (channel, value) => channel.pokeRaw(value) }

  private def pokeUInt(port: Rgb[UInt], values: Seq[Int]): Unit =
    port.channels.zip(values).foreach { case (channel, value) => channel.poke(value) }
}
