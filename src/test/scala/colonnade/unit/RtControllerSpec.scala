package colonnade.unit

import chiseltest._
import colonnade.{Always, Matrix, Proofs, Simulation, TestConfigs}
import colonnade.config.ColonnadeConfig
import colonnade.TestParts._
import org.scalatest.flatspec.AnyFlatSpec

/** A context changes its state on the events of its stage, and only then. */
class RtControllerSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "RtController"

  private def config(contexts: Int, base: ColonnadeConfig = TestConfigs.tiny): ColonnadeConfig =
    base.copy(units = base.units.copy(pathContexts = contexts))

  for ((contexts, extraSlices) <- Seq((1, false), (3, false), (3, true), (16, false)))
    it should s"follow $contexts contexts through random events, extra slices $extraSlices" taggedAs Always.unless(
      contexts != 3
    ) in
      test(
        new RtController(
          config(contexts, if (extraSlices) TestConfigs.withExtraSlices(TestConfigs.tiny) else TestConfigs.tiny)
        )
      ).withAnnotations(Simulation.verilator) { dut =>
        for ((eagerness, seed) <- Seq((0.9, 1), (0.15, 2)))
          new ControllerDriver(dut, contexts, seed, isLate = extraSlices).run(pixels = 70, eagerness)
      }

  for (contexts <- Seq(1, 3, 16))
    it should s"follow $contexts contexts with an environment, enabled or not" taggedAs Always.unless(contexts == 3) in
      test(new RtController(config(contexts, TestConfigs.withEnvironment(TestConfigs.environment))))
        .withAnnotations(Simulation.verilator) { dut =>
          val outcomes =
            for ((eagerness, hasEnvironment, seed) <- Seq((0.9, true, 3), (0.15, true, 4), (0.5, false, 5))) yield {
              val rounds = new ControllerDriver(dut, contexts, seed, hasEnvironment, occlusion = !hasEnvironment)
              rounds.run(pixels = 70, eagerness)
              assert(rounds.tests.isEmpty)
              rounds.outcomes
            }
          val rounds = new ControllerDriver(dut, contexts, seed = 6, hasEnvironment = true, occlusion = true)
          rounds.run(pixels = 300, eagerness = 0.8)
          assert(rounds.tests.size == 4, "hits of primary and later rays, hidden and visible")
          assert(outcomes.flatten.distinct.size == 4, "all results of the march occur")
          assert(outcomes.last.isEmpty)
        }

  for ((contexts, hasEnvironment, extraSlices) <- Seq((3, false, false), (16, true, false), (4, false, true)))
    it should s"follow $contexts contexts that gather, with an environment $hasEnvironment, extra slices $extraSlices" in {
      val scene = if (hasEnvironment) TestConfigs.withEnvironment(TestConfigs.environment) else TestConfigs.tiny
      val base  = TestConfigs.gathering(if (extraSlices) TestConfigs.withExtraSlices(scene) else scene)
      test(new RtController(config(contexts, base))).withAnnotations(Simulation.verilator) { dut =>
        for ((eagerness, gathers, seed) <- Seq((0.9, 4, 7), (0.2, 1, 8), (0.7, 0, 9))) {
          val rounds =
            new ControllerDriver(dut, contexts, seed, hasEnvironment, hasEnvironment, gathers, isLate = extraSlices)
          rounds.run(pixels = 150, eagerness)
          assert((rounds.gathered > 5) == (gathers > 0), s"${rounds.gathered} gathered rays")
          assert((rounds.returned > 5) == (gathers > 0 && hasEnvironment), s"${rounds.returned} to the environment")
        }
      }
    }

  it should "resolve one ended ray and retire one pixel per cycle" in
    test(new RtController(config(contexts = 4))) { dut =>
      val rounds = new ControllerDriver(dut, count = 4, seed = 1)
      for (_ <- 0 until 3) rounds.cycle(_.allocate = true)
      rounds.cycle(_.hasResult = Some(0))
      rounds.cycle(_.retire = true)
      dut.io.idleCount.expect(1)
      rounds.cycle { events =>
        events.missesBox = Some(1)
        events.hasResult = Some(2)
      }
      for (_ <- 0 until 2) {
        dut.io.trace.query.valid.expect(true)
        rounds.cycle(_.retire = true)
      }
      dut.io.trace.query.valid.expect(false)
      rounds.cycle(_.retire = true)
      dut.io.idleCount.expect(3)
    }
}

class RtControllerProofSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "RtController"

  private val environment = TestConfigs.withEnvironment(TestConfigs.environment)

  private def config(contexts: Int, base: ColonnadeConfig): ColonnadeConfig =
    base.copy(units = base.units.copy(pathContexts = contexts))

  for ((name, base) <- Seq("without" -> TestConfigs.tiny, "with" -> environment))
    it should s"give each path to its stages, once and in order, $name an environment" taggedAs Always.unless(
      !base.hasEnvironment
    ) in
      prove(new RtControllerProof(config(contexts = 2, base)))

  for ((name, base, cycles) <- Seq(("without", TestConfigs.tiny, 13), ("with", environment, 10)))
    it should s"give each of 17 paths to its stages, $name an environment" taggedAs Matrix in
      proveUntil(cycles)(new RtControllerProof(config(contexts = 17, base)))
}
