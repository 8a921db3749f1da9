package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, RegEnable, Valid}
import chiseltest._
import colonnade.TestParts._
import colonnade.common.Context
import colonnade.config.{ColonnadeConfig, PathConfig}
import colonnade.formats.{EnvironmentView, Load}
import colonnade.shading.EnvironmentSurface
import colonnade.{Model, OneSimulation, Packed, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** The ports of [[EnvironmentRays]]; each wide one is a number. */
private class RayPorts(config: ColonnadeConfig) extends Bundle {
  val ray         = Flipped(Valid(UInt(new StoredRay(config).getWidth.W)))
  val req         = Flipped(Decoupled(new EnvironmentRequest(config)))
  val hitDistance = Input(HitDistance(config))
  val isMapCamera = Input(Bool())
  val surface     = Decoupled(UInt(new EnvironmentSurface(config).getWidth.W))
  val miss        = Valid(Context(PathConfig(config)))
  val visible     = Valid(Context(PathConfig(config)))
}

/** The rays of a path unit, its marches, and slow maps. */
private class EnvironmentMarchesHarness(config: ColonnadeConfig) extends Module {
  private val marches = Module(new EnvironmentMarches(config))
  private val maps    = Module(new PhysicalAttributeMemory(config, config.mapRequesters, tagBits = 0))

  val paths  = IO(new RayPorts(config))
  val view   = IO(Input(UInt(marches.io.view.getWidth.W)))
  val load   = IO(Flipped(Valid(new Load(config))))
  val start  = IO(Input(Bool()))
  val events = IO(chiselTypeOf(marches.io.events))
  marches.io.view  := view.asTypeOf(marches.io.view)
  marches.io.start := start
  maps.io.load     := load
  events           := marches.io.events
  marches.io.maps.zip(maps.io.ports).foreach { case (march, port) => SlowMaps.connect(march, port, isSlow = true.B) }
  private val rays = Module(new EnvironmentRays(config)).io
  marches.io.paths :<>= rays.marches
  rays.again          := 0.U.asTypeOf(rays.again) // no path gathers
  rays.isMapCamera    := paths.isMapCamera
  rays.ray.valid      := paths.ray.valid
  rays.ray.bits       := paths.ray.bits.asTypeOf(rays.ray.bits)
  rays.hitDistance    := paths.hitDistance
  paths.surface.valid := rays.surface.valid
  paths.surface.bits  := rays.surface.bits.asUInt
  paths.miss          := rays.miss
  paths.visible       := rays.visible
  rays.req :<>= paths.req
  rays.surface.ready := paths.surface.ready

  // An offer may pause, but stays the same until it is taken
  private val surface   = paths.surface
  private val isOffered = RegInit(false.B)
  private val offered   = RegEnable(surface.bits, surface.valid)
  when(surface.fire) { isOffered := false.B }.elsewhen(surface.valid) { isOffered := true.B }
  assert(!(surface.valid && isOffered) || surface.bits === offered, "another surface than that before")
}

class EnvironmentMarchesSpec extends AnyFlatSpec with OneSimulation {
  behavior of "EnvironmentMarches"

  private case class Request(ray: MarchCase, isFresnelReflection: Boolean, isOcclusionTest: Boolean)

  /** What came back: a surface or none, and whether the object's hit is visible. */
  private case class Answer(request: Request, surface: Option[BigInt], isVisible: Boolean)

  /** The driver of the rays. */
  private class Rays(port: RayPorts, config: ColonnadeConfig, nextRay: () => MarchCase, random: Random) {
    private val stored   = new Packed(new StoredRay(config))
    private var rays     = Map.empty[Int, MarchCase]
    private var offered  = Option.empty[Request]
    private var distance = Option.empty[BigInt]

    /** By context; the largest number of them. */
    private var inFlight = Map.empty[Int, Request]
    var maxInFlight      = 0

    /** Contexts whose answer has come, in order of the requests. */
    var answers = Vector.empty[Answer]

    def isIdle: Boolean = inFlight.isEmpty && offered.isEmpty

    /** Requests that the marches have taken; those and one that is offered. */
    var requests   = Vector.empty[Request]
    def begun: Int = requests.size + offered.size

    /** @param asks may store another ray, and request another answer */
    def step(willing: Double, asks: Boolean): Unit = {
      val free =
        (0 until config.units.pathContexts).filterNot(c => inFlight.contains(c) || offered.exists(_.ray.context == c))
      val next = Option.when(asks && free.nonEmpty && random.nextInt(6) == 0) {
        nextRay().copy(context = free(random.nextInt(free.size)))
      }
      port.ray.valid.poke(next.nonEmpty)
      for (ray <- next)
        port.ray.bits.poke(stored.pack(ray.fields(config.numbers.shadeBits) - "isDirectView" - "hitDistance"))
      val ready = free.filter(context => rays.contains(context) && !next.exists(_.context == context))
      if (asks && offered.isEmpty && ready.nonEmpty && random.nextInt(4) == 0)
        offered = Some(Request(rays(ready(random.nextInt(ready.size))), random.nextBoolean(), random.nextBoolean()))
      port.hitDistance.poke(distance.getOrElse(BigInt(config.numbers.sceneBits, random)))
      distance = None
      port.req.valid.poke(offered.nonEmpty)
      for (request <- offered) {
        port.req.bits.context.poke(request.ray.context)
        port.req.bits.isDirectView.poke(request.ray.isDirectView)
        port.req.bits.isFresnelReflection.poke(request.isFresnelReflection)
        port.req.bits.isOcclusionTest.poke(request.isOcclusionTest)
      }
      val takes = random.nextDouble() < willing
      port.surface.ready.poke(takes)
      if (takes && port.surface.valid.peekBoolean()) {
        val bits    = port.surface.bits.peekInt()
        val context = new Packed(new EnvironmentSurface(config)).unpack(bits)("context").toInt
        rays -= context // the point has taken its place
        end(context, Some(bits), isVisible = false)
      }
      if (port.miss.valid.peekBoolean()) end(port.miss.bits.peekInt().toInt, None, isVisible = false)
      if (port.visible.valid.peekBoolean()) end(port.visible.bits.peekInt().toInt, None, isVisible = true)
      if (port.req.ready.peekBoolean()) for (request <- offered) {
        inFlight += request.ray.context -> request
        requests :+= request
        maxInFlight = maxInFlight.max(inFlight.size)
        distance = Some(request.ray.hitDistance)
        offered = None
      }
      for (ray <- next) rays += ray.context -> ray
    }

    private def end(context: Int, surface: Option[BigInt], isVisible: Boolean): Unit = {
      answers :+= Answer(inFlight(context), surface, isVisible)
      inFlight -= context
    }
  }

  private val base   = TestConfigs.withEnvironment(TestConfigs.environment)
  private val config = base.copy(units = base.units.copy(pathContexts = 12, marches = 2))

  inOneSimulation(new EnvironmentMarchesHarness(config))(
    "answer each request as the model does, the maps' camera"  -> (check(_, isMapCamera = true)),
    "any camera"                                               -> (check(_, isMapCamera = false)),
    "report illegal words of the maps that any march comes to" -> reportIllegal _
  )

  private def check(dut: EnvironmentMarchesHarness, isMapCamera: Boolean): Unit = {
    val random   = new Random(3)
    val stimulus = new MarchStimulus(config, random)
    val scene    = new EnvironmentScene(config, random)
    dut.clock.setTimeout(0)
    dut.paths.isMapCamera.poke(isMapCamera)
    EnvironmentImage.load(dut.load, dut.clock, config, scene.words)
    // Frames of different cameras
    for (from <- Seq(Seq(0.3, 0.1, -0.2), Seq(-0.4, 0.2, 0.3)))
      checkFrame(dut, stimulus, scene, isMapCamera, from, random)
  }

  private def model(words: Map[String, Seq[BigInt]], view: ViewCase, rays: Seq[MarchCase]) =
    Model.attributes(config, words, rays.map(view.words ++ _.words), "march").map(MarchCase.answer.zip(_).toMap)

  private def reportIllegal(dut: EnvironmentMarchesHarness): Unit = {
    val random   = new Random(4)
    val stimulus = new MarchStimulus(config, random)
    val image    = new EnvironmentImage(config, random, illegal = 0.1)
    val scene    = new EnvironmentScene(config, random)
    val camera   = new stimulus.Camera(scene.focal, scene.middle, isTurned = true)
    val view     = camera.view.copy(isMapCamera = false)
    dut.clock.setTimeout(0)
    EnvironmentImage.load(dut.load, dut.clock, config, image.words)
    dut.view.poke(new Packed(new EnvironmentView(config.numbers)).pack(view.fields))
    dut.start.poke(true)
    dut.clock.step()
    dut.start.poke(false)

    // Two rays at a time, one for each march
    val rounds = for (_ <- 0 until 20) yield {
      val rays      = new Rays(dut.paths, config, () => stimulus.inRoom(camera), random)
      var isIllegal = false
      var cycles    = 0
      while (rays.begun < 2 || !rays.isIdle) {
        rays.step(willing = 1, asks = rays.begun < 2)
        isIllegal ||= dut.events.illegalRecord.peekBoolean()
        cycles += 1
        assert(cycles < 10000)
        dut.clock.step()
      }
      (rays.requests.map(_.ray), isIllegal)
    }
    val models = model(image.words, view, rounds.flatMap(_._1))
    for ((both, (_, isIllegal)) <- models.map(_("isIllegal") == 1).grouped(2).zip(rounds))
      assert(isIllegal == both.contains(true))
    assert(models.map(_("isIllegal")).distinct.size == 2)
  }

  /** @param from the position of a camera that is not the maps', in that one's view space */
  private def checkFrame(
      dut:         EnvironmentMarchesHarness,
      stimulus:    MarchStimulus,
      scene:       EnvironmentScene,
      isMapCamera: Boolean,
      from:        Seq[Double],
      random:      Random
  ): Unit = {
    val camera = new stimulus.Camera(scene.focal, scene.middle, isTurned = true)
    val view   = camera.view.copy(isMapCamera = isMapCamera)
    // All rays from a camera have its position
    val position = camera.steps(if (isMapCamera) Seq(0.0, 0.0, 0.0) else from)
    def seen     =
      (if (isMapCamera) stimulus.fromCamera(camera) else stimulus.fromElsewhere(camera)).copy(origin = position)
    def nextRay = if (random.nextInt(3) == 0) seen else stimulus.inRoom(camera)
    dut.view.poke(new Packed(new EnvironmentView(config.numbers)).pack(view.fields))
    dut.start.poke(true)
    dut.clock.step()
    dut.start.poke(false)

    val rays   = new Rays(dut.paths, config, () => nextRay, random)
    var cycles = 0
    var steps  = BigInt(0)
    while (rays.answers.size < 90 || !rays.isIdle) {
      rays.step(willing = 0.05, asks = rays.answers.size < 90)
      steps += dut.events.marchSteps.peekInt()
      cycles += 1
      assert(cycles < 60000, s"only ${rays.answers.size} answers")
      dut.clock.step()
    }
    assert(rays.maxInFlight > (if (isMapCamera) 4 else 3), "several contexts are under way at a time")

    val answers = rays.answers
    val models  = model(scene.words, view, answers.map(_.request.ray))
    for ((Answer(request, surface, isVisible), expected) <- answers.zip(models)) {
      val isHit =
        if (request.isOcclusionTest) expected("hidesObject") == 1 else expected("kind") != HitKind.miss.litValue
      assert(surface.nonEmpty == isHit && isVisible == (request.isOcclusionTest && !isHit), s"of $request")
      for (bits <- surface) {
        val values = new Packed(new EnvironmentSurface(config)).unpack(bits)
        val added  = Map(
          "context" -> BigInt(request.ray.context),
          "shadows" -> BigInt(if (request.isFresnelReflection) 0 else 1)
        )
        assert(values == (expected.filter(value => values.contains(value._1)) ++ added), s"of $request")
      }
    }
    assert(steps >= models.map(_("steps")).sum, "steps are counted")
    assert(answers.exists(_.isVisible) && answers.exists(a => a.request.isOcclusionTest && a.surface.nonEmpty))
    assert(answers.exists(_.request.ray.isDirectView) && answers.exists(!_.request.ray.isDirectView))
  }
}
