package colonnade.environment

import chisel3._
import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.{Always, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

private class DirectViewHarness(config: ColonnadeConfig) extends OrderHarness(config) {
  private val pipeline = Module(new DirectView(config)).io
  connect(pipeline.view, pipeline.order, pipeline.answer, pipeline.maps)
  MarchUnit.tieOff(pipeline.march)
  isReady   := pipeline.isReady
  isIllegal := pipeline.isIllegal
}

class DirectViewSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "DirectView"

  private val configs =
    Seq(0, 4, 1).map(TestConfigs.formats).map(_.copy(physicalAttributeMemory = Some(TestConfigs.environment))) :+
      TestConfigs.slicEnvironments.head

  for ((config, seed) <- configs.zipWithIndex) {
    val size = config.physicalAttributeMemory.get

    val name = s"${config.precision}, ${size.encoding.name} maps of ${size.width}x${size.height}"
    it should s"see what the march sees: $name" taggedAs Always.unless(seed % 2 == 1) in
      test(new DirectViewHarness(config)).withAnnotations(Simulation.verilator) { dut =>
        val random   = new Random(seed)
        val stimulus = new MarchStimulus(config, random)
        val scene    = new EnvironmentScene(config, random)
        val image    = new EnvironmentImage(config, random, illegal = 0.3)
        dut.clock.setTimeout(0)

        var cycles  = Seq.empty[Double]
        var answers = Seq.empty[Map[String, BigInt]]
        for (round <- 0 until 8) {
          val words  = if (round < 4) scene.words else image.words
          val camera = new stimulus.Camera(scene.focal, scene.middle, isTurned = round % 2 == 1)
          val view   = if (round < 6) camera.view else stimulus.wildView()
          val rays   = Seq.fill(30)(if (round < 6) stimulus.fromCamera(camera) else stimulus.wildPixel())
          if (round == 0 || round == 4) EnvironmentImage.load(dut.load, dut.clock, config, words)
          val origin = rays.head.origin
          val orders = new Orders(dut, config, view, words, random)
          answers ++= orders.check(
            rays.map(_.copy(origin = origin)),
            willing = if (round == 0) 1 else random.nextDouble().max(0.1),
            isSlow = round > 0
          )
          if (round == 0) cycles :+= orders.cycles.toDouble / rays.size
        }
        assert(cycles.forall(_ < 6), s"$cycles cycles a pixel")
        assert(answers.exists(_("isIllegal") == 1) && answers.exists(_("kind") == HitKind.miss.litValue))
        assert(answers.exists(_("kind") == HitKind.map.litValue))
      }
  }
}
