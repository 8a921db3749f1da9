package colonnade.environment

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{EnvironmentView, Load}
import colonnade.{Always, Model, Packed, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** The pipeline with its maps; each wide port is one number. */
private class DirectViewHarness(config: ColonnadeConfig) extends Module {
  private val pipeline = Module(new DirectView(config))
  private val maps     = Module(new PhysicalAttributeMemory(config, 1, tagBits = 0))

  val load      = IO(Flipped(Valid(new Load(config))))
  val view      = IO(Input(UInt(pipeline.io.view.getWidth.W)))
  val order     = IO(Flipped(Valid(UInt(pipeline.io.order.bits.getWidth.W))))
  val isSlow    = IO(Input(Bool()))
  val isReady   = IO(Output(Bool()))
  val answer    = IO(chisel3.util.Decoupled(UInt(pipeline.io.answer.bits.getWidth.W)))
  val isIllegal = IO(Output(Bool()))
  pipeline.io.view         := view.asTypeOf(pipeline.io.view)
  pipeline.io.order.valid  := order.valid
  pipeline.io.order.bits   := order.bits.asTypeOf(pipeline.io.order.bits)
  pipeline.io.answer.ready := answer.ready
  answer.valid             := pipeline.io.answer.valid
  answer.bits              := pipeline.io.answer.bits.asUInt
  isReady                  := pipeline.io.isReady
  isIllegal                := pipeline.io.isIllegal
  SlowMaps.connect(pipeline.io.maps, maps.io.ports.head, isSlow)
  maps.io.load := load
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
          dut.view.poke(new Packed(new EnvironmentView(config.numbers)).pack(view.fields))
          val origin = rays.head.origin
          answers ++= check(
            dut,
            config,
            words,
            view,
            rays.map(_.copy(origin = origin)),
            random,
            willing = if (round == 0) 1 else random.nextDouble().max(0.1),
            isSlow = round > 0
          )
          if (round == 0) cycles :+= time
        }
        assert(cycles.forall(_ < 6), s"$cycles cycles a pixel")
        assert(answers.exists(_("isIllegal") == 1) && answers.exists(_("kind") == HitKind.miss))
        assert(answers.exists(_("kind") == HitKind.map))
      }
  }

  private var time = 0.0

  /** Compares with the model; returns the model's answers. */
  private def check(
      dut:     DirectViewHarness,
      config:  ColonnadeConfig,
      words:   Map[String, Seq[BigInt]],
      view:    ViewCase,
      rays:    Seq[MarchCase],
      random:  Random,
      willing: Double,
      isSlow:  Boolean
  ): Seq[Map[String, BigInt]] = {
    val (order, answer) = (new Packed(new MarchOrder(config)), new Packed(new MarchAnswer(config)))
    val isTest          = rays.map(_ => random.nextBoolean())
    dut.isSlow.poke(isSlow)
    var sent      = 0
    var found     = Vector.empty[BigInt]
    var mayOrder  = false
    var isIllegal = false
    var cycle     = 0
    while (found.size < rays.size) {
      val sends = mayOrder && sent < rays.size && (willing == 1 || random.nextInt(4) > 0)
      dut.order.valid.poke(sends)
      if (sends) {
        dut.order.bits.poke(order.pack(rays(sent).fields(config.numbers.shadeBits) - "context" - "isDirectView" ++ Map(
          "request.context"             -> BigInt(rays(sent).context),
          "request.isDirectView"        -> BigInt(1),
          "request.isFresnelReflection" -> BigInt(sent % 2),
          "request.isOcclusionTest"     -> BigInt(if (isTest(sent)) 1 else 0)
        )))
        sent += 1
      }
      val takes = random.nextDouble() < willing
      dut.answer.ready.poke(takes)
      if (takes && dut.answer.valid.peekBoolean()) found :+= dut.answer.bits.peekInt()
      isIllegal |= dut.isIllegal.peekBoolean()
      mayOrder = !sends && dut.isReady.peekBoolean()
      cycle += 1
      assert(cycle < 10000, s"${found.size} answers")
      dut.clock.step()
    }
    dut.order.valid.poke(false)
    time = cycle / rays.size.toDouble

    val expected =
      Model.attributes(
        config,
        words,
        rays.map(ray => view.words ++ ray.words),
        "march"
      ).map(MarchCase.answer.zip(_).toMap)
    for ((((bits, expected), ray), index) <- found.zip(expected).zip(rays).zipWithIndex) {
      val values = answer.unpack(bits).map { case (name, value) =>
        name.replace("surface.", "") -> value
      }
      val isHit = if (isTest(index)) expected("hidesObject") == 1 else expected("kind") == HitKind.map
      assert(values("isHit") == (if (isHit) 1 else 0), s"of $ray in $view")
      assert(values("context") == ray.context && values("shadows") == 1 - index % 2)
      if (isHit) for ((name, value) <- expected if values.contains(name))
        assert(values(name) == value, s"$name of $ray in $view")
    }
    assert(isIllegal == expected.exists(_("isIllegal") == 1))
    expected
  }
}
