package colonnade.environment

import chisel3._
import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.{Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

private class MarchSlotHarness(config: ColonnadeConfig) extends OrderHarness(config) {
  private val march = Module(new MarchUnit(config))
  connect(march.view, march.order, march.answer, march.maps)
  isReady   := march.isEmpty
  isIllegal := march.isIllegal
}

class MarchSlotSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "MarchSlot"

  it should "answer each order once, with its own context and flags, however long an answer waits" in {
    val config = TestConfigs.withEnvironment(TestConfigs.environment)
    test(new MarchSlotHarness(config)).withAnnotations(Simulation.verilator) { dut =>
      val random   = new Random(1)
      val stimulus = new MarchStimulus(config, random)
      val scene    = new EnvironmentScene(config, random)
      val image    = new EnvironmentImage(config, random, illegal = 0.3)
      dut.clock.setTimeout(0)
      val answers = for ((words, willing) <- Seq(scene.words -> 1.0, scene.words -> 0.005, image.words -> 0.3)) yield {
        val camera = new stimulus.Camera(scene.focal, scene.middle, isTurned = true)
        val rays   = Seq.fill(20)(stimulus.inRoom(camera)) ++ Seq.fill(10)(stimulus.fromElsewhere(camera))
        val orders = new Orders(dut, config, camera.view.copy(isMapCamera = false), words, random)
        EnvironmentImage.load(dut.load, dut.clock, config, words)
        orders.check(random.shuffle(rays), willing, isSlow = willing < 1)
      }
      val all = answers.flatten
      for (kind <- HitKind.all) assert(all.exists(_("kind") == kind.litValue))
      for (bit <- 0 to 1; name <- Seq("hidesObject", "isIllegal")) assert(all.exists(_(name) == bit), name)
    }
  }
}
