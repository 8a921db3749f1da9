package colonnade.shading

import chisel3._
import chiseltest._
import colonnade.RandomPorts.peek
import colonnade.TestParts._
import colonnade.common.ModuloSchedule
import colonnade.config.ColonnadeConfig
import colonnade.{Always, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** The shader and its pipeline side by side, with the same registers. */
private class ShadersHarness(config: ColonnadeConfig) extends Module {
  val registers = IO(new ShaderIO(config))

  private val units = Seq(Module(new SequentialShader(config)).io, Module(new ShadingPipeline(config)).io)
  val shaders       = units.map(unit => IO(chiselTypeOf(unit)))
  for ((port, unit) <- shaders.zip(units)) {
    port <> unit
    unit.lights    := registers.lights
    unit.unitShift := registers.unitShift
    unit.shading   := registers.shading
    unit.materials := registers.materials
  }
  registers <> DontCare
}

class ShadingPipelineSpec extends AnyFlatSpec with ChiselScalatestTester {
  import ShaderDriver.{peek => _, _}

  behavior of "ShadingPipeline"

  private def withRoom(config: ColonnadeConfig) = config.copy(physicalAttributeMemory = Some(TestConfigs.environment))

  private val configs = Seq(
    withRoom(TestConfigs.tiny),
    withRoom(TestConfigs.tiny.copy(
      geometry = TestConfigs.tiny.geometry.copy(triangleBits = Some(24)),
      frame = TestConfigs.tiny.frame.copy(lights = 1, materials = 5, emission = true)
    )),
    TestConfigs.withPrecision(16, 16, 16),
    withRoom(TestConfigs.withPrecision(24, 20, 40).copy(
      geometry = TestConfigs.tiny.geometry.copy(cornerColours = true),
      frame = TestConfigs.tiny.frame.copy(lights = 5)
    )),
    TestConfigs.withPrecision(64, 64, 64).copy(frame = TestConfigs.tiny.frame.copy(maxBounces = 0))
  ).map(config => config.copy(units = config.units.copy(pathContexts = 16)))

  for ((config, seed) <- configs.zipWithIndex)
    it should s"equal the shader with ${config.precision}, ${config.frame.lights} lights and ${config.frame.maxBounces} bounces" taggedAs Always.unless(
      seed % 2 == 0
    ) in
      test(new ShadersHarness(config)).withAnnotations(Simulation.verilator) { dut =>
        dut.clock.setTimeout(0)
        val random   = new Random(seed)
        val stimulus = new ShaderStimulus(config, random)
        for (round <- 0 until 8) {
          val light = if (round < 4) stimulus.typicalLight() else stimulus.light()
          pokeLight(dut.registers, light)
          pokeBounces(dut.registers, config, random)
          abandon(dut, stimulus.surfaceHit(light), random)
          // A context has one hit at a time
          val inputs = Seq.tabulate(config.units.pathContexts) { context =>
            random.nextInt(if (config.hasEnvironment) 8 else 6) match {
              case 0 => Left(stimulus.anyHit().copy(context = context))
              case 1 => Left(stimulus.withoutSmoothNormal().copy(context = context))
              case 2 => Left(stimulus.withoutNormal().copy(context = context))
              case 6 => Right(stimulus.environmentPoint().copy(context = context))
              case 7 => Right(stimulus.typicalPoint().copy(context = context))
              case _ => Left(stimulus.surfaceHit(light).copy(context = context))
            }
          }
          val stalls               = if (round % 2 == 0) 0.0 else 0.6
          val Seq(expected, found) = dut.shaders.map(run(dut, _, inputs, random, stalls))
          assert(found._1 == expected._1, s"lit surfaces of round $round under $light")
          assert(found._2.sortBy(_.toString) == expected._2.sortBy(_.toString), s"bounced rays of round $round")
        }
      }

  /** Kinds of materials and their indices of refraction. */
  private def pokeBounces(io: ShaderIO, config: ColonnadeConfig, random: Random): Unit =
    for ((material, index) <- io.materials.zipWithIndex; kind <- material.kind) {
      kind.poke(if (index == 0) 0 else random.nextInt(3))
      for (eta <- Seq(material.etaFront, material.etaBack)) {
        eta.get.raw.asInstanceOf[UInt].poke((6000 + random.nextInt(6000)))
      }
      material.reflectance.get.raw.asInstanceOf[UInt].poke(random.nextInt(4097))
      for (emission <- material.emission; channel <- emission.channels) channel.poke(random.nextInt(4096))
    }

  /** Lit surfaces and bounced rays of a unit, each in their order. Hits come after a promise, points at any time; the
    * order of both is that of the inputs, so that a unit has only one of them to take.
    */
  private def run(
      dut:    ShadersHarness,
      io:     ShaderIO,
      inputs: Seq[Either[HitCase, EnvironmentPointCase]],
      random: Random,
      stalls: Double
  ): (Seq[Seq[BigInt]], Seq[Seq[BigInt]]) = {
    var (left, lit, bounced) = (inputs, Vector.empty[Seq[BigInt]], Vector.empty[Seq[BigInt]])
    var isPromised           = false
    var (idle, held)         = (0, Seq.fill(2)(Option.empty[Seq[BigInt]]))
    def isWilling            = random.nextDouble() >= stalls
    while (lit.size + bounced.size < inputs.size) {
      val point   = left.headOption.flatMap(_.toOption)
      val hit     = left.headOption.flatMap(_.swap.toOption).filter(_ => isPromised && isWilling)
      val accepts = Seq.fill(2)(isWilling)
      io.request.valid.poke(hit.nonEmpty)
      hit.foreach(pokeHit(io.request.bits, _))
      for (port <- io.environment) {
        port.valid.poke(point.nonEmpty)
        point.foreach(pokePoint(port.bits, _))
      }
      io.lit.ready.poke(accepts.head)
      io.bounced.foreach(_.ready.poke(accepts.last))
      if (hit.nonEmpty) io.request.ready.expect(true, "a promised hit is taken")
      if (hit.nonEmpty || (point.nonEmpty && io.environment.get.ready.peekBoolean())) left = left.tail
      val offered = Seq(
        Option.when(io.lit.valid.peekBoolean())(peek(io.lit.bits)),
        io.bounced.filter(_.valid.peekBoolean()).map(port => peek(port.bits))
      )
      for ((before, now) <- held.zip(offered); value <- before) assert(now.contains(value), "an offer has changed")
      held = offered.zip(accepts).map { case (offer, isTaken) => offer.filterNot(_ => isTaken) }
      if (accepts.head) lit ++= offered.head
      if (accepts.last) bounced ++= offered.last
      idle = if (offered.exists(_.nonEmpty)) 0 else idle + 1
      assert(idle < 1000, s"nothing leaves after ${lit.size} surfaces and ${bounced.size} rays of ${inputs.size}")
      isPromised = io.readyNext.peekBoolean()
      dut.clock.step()
    }
    (lit, bounced)
  }

  /** Resets the units for one cycle while they shade hits, of which nothing may come out. */
  private def abandon(dut: ShadersHarness, hit: HitCase, random: Random): Unit = {
    var arePromised = dut.shaders.map(_ => false)
    for (_ <- 0 until random.nextInt(100)) {
      for ((io, isPromised) <- dut.shaders.zip(arePromised)) {
        io.request.valid.poke(isPromised)
        pokeHit(io.request.bits, hit)
        (io.lit +: io.bounced.toSeq).foreach(_.ready.poke(true))
        io.environment.foreach(_.valid.poke(false))
      }
      arePromised = dut.shaders.map(_.readyNext.peekBoolean())
      dut.clock.step()
    }
    dut.reset.asBool.poke(true)
    dut.clock.step()
    dut.reset.asBool.poke(false)
    dut.shaders.foreach(_.request.valid.poke(false))
  }

  for (shining <- Seq(1, 2))
    it should s"take a hit every ${ModuloSchedule.interval * shining} cycles with $shining lights" in
      test(new ShaderHarness(TestConfigs.withPipelines(TestConfigs.tiny)))
        .withAnnotations(Simulation.verilator) { dut =>
          assert(dut.leaf == "ShadingPipeline")
          val stimulus = new ShaderStimulus(TestConfigs.tiny, new Random(3))
          val light    = stimulus.light().copy(shining = shining)
          pokeLight(dut.io, light)
          dut.io.request.valid.poke(true)
          dut.io.lit.ready.poke(true)
          pokeHit(dut.io.request.bits, stimulus.surfaceHit(light))
          var (taken, lit) = (0, 0)
          val cycles       = ModuloSchedule.interval * shining
          for (_ <- 0 until 100 * cycles) {
            if (dut.io.request.ready.peekBoolean()) taken += 1
            if (dut.io.lit.valid.peekBoolean()) lit += 1
            dut.clock.step()
          }
          assert(taken == 100 && lit > 80, s"$taken hits taken, $lit lit")
          info(s"${(taken - lit) * cycles} cycles from hit to lit surface")

          // Nobody takes a surface for a while, and then all leave
          for (cycle <- 0 until 800) {
            dut.io.lit.ready.poke(cycle >= 200)
            dut.io.request.valid.poke(cycle < 200)
            if (cycle < 200 && dut.io.request.ready.peekBoolean()) taken += 1
            if (cycle >= 200 && dut.io.lit.valid.peekBoolean()) lit += 1
            dut.clock.step()
          }
          assert(lit == taken && taken < 120, s"$taken hits taken, $lit lit")
        }
}
