package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, Valid}
import chiseltest._
import colonnade.{Simulation, TestConfigs}
import colonnade.config.{AttributeLayout, ColonnadeConfig, PathConfig}
import colonnade.formats.EnvironmentView
import colonnade.TestParts._
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** A march, and the stages that complete its hits: from an order to its answer. */
class MarchUnit(config: PathConfig) extends Module {
  private val layout = AttributeLayout.of(config.device)

  val view      = IO(Input(new EnvironmentView(config.numbers)))
  val order     = IO(Flipped(Valid(new MarchOrder(config))))
  val isEmpty   = IO(Output(Bool()))
  val answer    = IO(Decoupled(new MarchAnswer(config)))
  val maps      = IO(new AttributePort(layout))
  val events    = IO(Output(new MarchEvents))
  val isIllegal = IO(Output(Bool()))

  /** On the way to the answer. */
  val hit      = IO(Valid(new MarchHit(config)))
  val distance = IO(Valid(new DirectDistance(config)))

  private val slot  = Module(new MarchSlot(config)).io
  private val hits  = Module(new MarchHits(config)).io
  private val point = Module(new DirectPoint(config)).io
  slot.view   := view
  slot.camera := 0.U.asTypeOf(slot.camera) // rays of a spec have different origins
  slot.order  := order
  isEmpty     := slot.isEmpty
  events      := slot.events
  isIllegal   := slot.events.illegal || hits.illegal
  hits.hit :<>= slot.hit
  hits.texel := slot.texel
  maps.cells <> slot.maps.cells
  maps.planes <> slot.maps.planes
  maps.albedo <> hits.albedo
  maps.normals <> hits.normals
  point.view := view
  MarchUnit.tieOff(point.sources(0))
  point.sources(1) :<>= hits.point
  answer :<>= point.answer

  hit.valid      := slot.hit.fire
  hit.bits       := slot.hit.bits.hit
  distance.valid := hits.point.distance.fire
  distance.bits  := hits.point.distance.bits
}

object MarchUnit {

  /** A source that never has a point. */
  def tieOff(source: PointSource): Unit = {
    for (part <- Seq(source.pixel, source.distance, source.albedo, source.normal)) {
      part.valid := false.B
      part.bits  := DontCare
    }
    source.origin := DontCare
  }
}

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
