package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, RegEnable, Valid}
import chiseltest._
import colonnade.TestParts._
import colonnade.common.Context
import colonnade.config.{AttributeLayout, ColonnadeConfig, MapEncoding, NumberFormats, PathConfig}
import colonnade.formats.{AlbedoEntry, EnvironmentView, Load, Vec3}
import colonnade.numbers.{Fixed, StreamTester}
import colonnade.ray.RayFormats
import colonnade.{Always, Matrix, Model, Packed, PackedUnit, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** What the model answers. Fields that do not belong to the kind are 0. */
private class MarchResult(config: ColonnadeConfig) extends Bundle {
  private val formats = new MarchFormats(config)
  private val layout  = AttributeLayout.of(config)

  val context          = Context(PathConfig(config))
  val kind             = HitKind()
  val x                = UInt(layout.xBits.W)
  val y                = UInt(layout.yBits.W)
  val boundingPlane    = UInt(layout.boundingPlaneIndexBits.W)
  val isHidden         = Bool()
  val distance         = UInt((formats.f + 1).W)
  val distanceExponent = SInt(formats.shiftBits.W)
  val steps            = UInt(formats.stepBits.W)
  val point            = Vec3(new Fixed(new RayFormats(config.numbers).scene))
  val albedo           = new AlbedoEntry
  val normal           = Vec3(SInt(NumberFormats.normalBits.W))
  val hidesObject      = Bool()
  val isIllegal        = Bool()
}

/** A march with its maps; their responses are delayed if `isSlow`. All rays are occlusion tests. */
private class EnvironmentMarchHarness(config: ColonnadeConfig)
    extends PackedUnit(new MarchOrder(config), new MarchResult(config)) {
  private val march  = Module(new MarchUnit(config))
  private val maps   = Module(new PhysicalAttributeMemory(config, 1, tagBits = 0))
  private val order  = Wire(Decoupled(new MarchOrder(config)))
  private val answer = Wire(Decoupled(new MarchResult(config)))

  val load   = IO(Flipped(Valid(new Load(config))))
  val view   = IO(Input(UInt(march.view.getWidth.W)))
  val isSlow = IO(Input(Bool()))
  val events = IO(Output(new MarchEvents))

  connect(order, answer)
  SlowMaps.connect(march.maps, maps.io.ports.head, isSlow)
  maps.io.load := load
  march.view   := view.asTypeOf(march.view)
  events       := march.events

  // One ray at a time
  private val isBusy = RegInit(false.B)
  when(order.fire) { isBusy := true.B }.elsewhen(answer.fire) { isBusy := false.B }
  order.ready        := !isBusy && march.isEmpty
  march.order.valid  := order.fire
  march.order.bits   := order.bits
  answer.valid       := march.answer.valid
  march.answer.ready := answer.ready

  private val hit       = RegEnable(march.hit.bits, march.hit.valid)
  private val distance  = RegEnable(march.distance.bits, march.distance.valid)
  private val planeReq  = march.maps.planes.req
  private val plane     = RegEnable(planeReq.bits.content.index, planeReq.fire && planeReq.bits.content.isBoundingPlane)
  private val cells     = march.maps.cells.resp
  private val idBits    = AttributeLayout.of(config).planeIdBits
  private val named     = Reg(Vec(1 << idBits, Bool())) // planes of the ray's tiles so far
  private val steps     = Reg(UInt(new MarchFormats(config).stepBits.W))
  private val isIllegal = Reg(Bool())
  when(order.fire) {
    steps     := 0.U
    isIllegal := false.B
    named.foreach(_ := false.B)
  }.otherwise {
    steps     := steps + march.events.step
    isIllegal := isIllegal || march.isIllegal
    when(cells.valid)(for ((id, i) <- cells.bits.content.ids.zipWithIndex) when(i.U < cells.bits.content.count) {
      named(id) := true.B
    })
  }
  private val content = planeReq.bits.content
  assert(
    !planeReq.valid || content.isBoundingPlane || named(content.index(idBits - 1, 0)),
    "a plane that no tile has named"
  )
  private val surface = march.answer.bits.surface
  private val isMap   = hit.kind === HitKind.map
  private val isHit   = hit.kind =/= HitKind.miss
  private val result  = answer.bits
  result.context          := surface.context
  result.kind             := hit.kind
  result.x                := Mux(isMap, hit.pixel.x, 0.U)
  result.y                := Mux(isMap, hit.pixel.y, 0.U)
  result.boundingPlane    := Mux(hit.kind === HitKind.boundingPlane, plane, 0.U)
  result.isHidden         := isMap && hit.isHidden
  result.distance         := Mux(isHit, distance.distance, 0.U)
  result.distanceExponent := Mux(isHit, distance.exponent, 0.S)
  result.steps            := steps
  result.hidesObject      := march.answer.bits.isHit
  result.isIllegal        := isIllegal
  for ((to, from) <- result.point.axes.zip(surface.point.axes)) to   := Fixed(to.format, Mux(isHit, from.integer, 0.S))
  for ((to, from) <- result.normal.axes.zip(surface.normal.axes)) to := Mux(isHit, from, 0.S)
  for ((to, from) <- Seq(result.albedo.r, result.albedo.g, result.albedo.b).zip(surface.albedo.channels))
    to := Mux(isHit, from, 0.U)
}

class EnvironmentMarchSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "EnvironmentMarch"

  private val names = MarchCase.answer

  /** Compares with the model; returns the model's answers. */
  private def check(
      unit:   EnvironmentMarchHarness,
      config: ColonnadeConfig,
      words:  Map[String, Seq[BigInt]],
      view:   ViewCase,
      rays:   Seq[MarchCase],
      random: Random,
      isSlow: Boolean
  ): Seq[Map[String, BigInt]] = {
    val (order, result) = (new Packed(new MarchOrder(config)), new Packed(new MarchResult(config)))
    unit.view.poke(new Packed(new EnvironmentView(config.numbers)).pack(view.fields))
    unit.isSlow.poke(isSlow)
    val inputs = rays.map { ray =>
      val fields = ray.fields(config.numbers.shadeBits)
      val names  = Seq("context", "isDirectView")
      order.pack(
        fields -- names ++ names.map(name => s"request.$name" -> fields(name)) +
          ("request.isFresnelReflection" -> BigInt(0)) + ("request.isOcclusionTest" -> BigInt(1))
      )
    }
    val found = StreamTester.exchange(unit.clock, unit.in, unit.out, inputs)(
      (port: UInt, bits: BigInt) => port.poke(bits),
      (port: UInt) => port.peekInt()
    )(random, if (isSlow) 0.5 else 0, 20000)
    val marching = view.copy(isMapCamera = false)
    val answers  = Model.attributes(config, words, rays.map(ray => marching.words ++ ray.words), "march")
    for (((bits, answer), ray) <- found.zip(answers).zip(rays)) {
      val expected = names.zip(answer).toMap + ("context" -> BigInt(ray.context))
      assert(result.unpack(bits) == expected, s"of $ray in $view with ${config.precision}")
    }
    answers.map(names.zip(_).toMap)
  }

  private def environments: Seq[ColonnadeConfig] =
    TestConfigs.formats.map(_.copy(physicalAttributeMemory = Some(TestConfigs.environment))) ++
      TestConfigs.environments.tail :+ TestConfigs.slicEnvironments.head

  for ((config, seed) <- environments.zipWithIndex) {
    val size = config.physicalAttributeMemory.get
    val name =
      s"${config.precision}, ${config.geometry.vertexBits}-bit vertices and a ${size.encoding.name} map of ${size.width}x${size.height}"

    val isCommon = size.width != TestConfigs.environment.width || size.encoding == MapEncoding.Slic
    // Beyond the format of the presets a part of the rays shows what depends on widths
    val part = if (config.precision == TestConfigs.tiny.precision) 2 else 4
    it should s"hit what the model hits, with $name" taggedAs (if (isCommon) Matrix else Always.ifExtreme(config)) in {
      val random   = new Random(seed)
      val stimulus = new MarchStimulus(config, random)
      test(new EnvironmentMarchHarness(config)).withAnnotations(Simulation.verilator) { unit =>
        unit.clock.setTimeout(0)
        val scene = new EnvironmentScene(config, random)
        EnvironmentImage.load(unit.load, unit.clock, config, scene.words)
        val hits = for (round <- 0 until 4) yield {
          val middle = if (round == 3) Seq(0.0, 0.0) else scene.middle
          val camera = new stimulus.Camera(scene.focal, middle, isTurned = round % 2 == 1)
          check(
            unit,
            config,
            scene.words,
            camera.view,
            Seq.fill(60 / part)(stimulus.inRoom(camera)) ++ Seq.fill(20)(stimulus.behindBox(camera)) ++
              Seq.fill(30)(stimulus.fromElsewhere(camera)),
            random,
            isSlow = round == 1
          )
        }
        val kinds                     = hits.flatten.map(_("kind"))
        val seen                      = hits.flatMap(_.takeRight(30))
        def count(kind: HitKind.Type) = seen.count(_("kind") == kind.litValue)
        assert(count(HitKind.map) > 20 && count(HitKind.miss) > 10, "cameras see")
        assert(count(HitKind.boundingPlane) == 0, "a camera sees no bounding plane")
        assert(HitKind.all.forall(kind => kinds.contains(kind.litValue)), "every kind of result")
        // With the widest formats the way to each point is saturated
        for (isHidden <- if (config.numbers.sceneBits < 56) Seq(0, 1) else Seq(0))
          assert(
            hits.flatten.exists(hit => hit("kind") == HitKind.map.litValue && hit("hidesObject") == isHidden),
            "occlusion"
          )
        assert(hits.flatten.exists(_("isHidden") == 1) && hits.flatten.exists(_("steps") > 5))

        val image = new EnvironmentImage(config, random)
        EnvironmentImage.load(unit.load, unit.clock, config, image.words)
        for (round <- 0 until 4 / part) {
          val camera = new stimulus.Camera(scene.focal, scene.middle, isTurned = true)
          check(
            unit,
            config,
            image.words,
            camera.view,
            Seq.fill(30)(stimulus.inRoom(camera)) ++ Seq.fill(20)(stimulus.fromElsewhere(camera)),
            random,
            isSlow = round == 1
          )
          check(
            unit,
            config,
            image.words,
            stimulus.anyView(),
            Seq.fill(20)(stimulus.anyRay()) ++ Seq.fill(20)(stimulus.anyPixel()),
            random,
            isSlow = round == 1
          )
        }

        // Illegal maps and illegal registers, separately and together
        val illegal = new EnvironmentImage(config, random, illegal = 0.3)
        EnvironmentImage.load(unit.load, unit.clock, config, illegal.words)
        val answers = for (round <- 0 until 8 / part) yield {
          val camera = new stimulus.Camera(scene.focal, scene.middle, isTurned = true)
          check(
            unit,
            config,
            illegal.words,
            if (round < 4 / part) camera.view else stimulus.wildView(),
            Seq.fill(10)(stimulus.inRoom(camera)) ++ Seq.fill(10)(stimulus.fromElsewhere(camera)) ++
              Seq.fill(10)(stimulus.anyRay()) ++ Seq.fill(10)(stimulus.anyPixel()),
            random,
            isSlow = round == 1
          )
        }
        val found = answers.flatten.map(_("isIllegal").toInt).toSet
        // Too few pointers lead out of the largest heaps
        val words  = size.layout.mapHeapWords.min(size.layout.planeHeapWords)
        val isFull = words > (1 << AttributeLayout.pointerBits) - 64
        assert(found(0) && (isFull || found(1)), "legal and illegal tiles")
        if (config.numbers.macBits == 64) clipFar(unit, config)
      }
    }
  }

  /** Clips a ray whose projection has a far larger exponent than the maps, at 64 bits. */
  private def clipFar(unit: EnvironmentMarchHarness, config: ColonnadeConfig): Unit = {
    def numbers(values: String*): Seq[BigInt] = values.map(BigInt(_))

    val random = new Random(1)
    val ray    = MarchCase(
      context = 3,
      origin = numbers("-56223315771477880000", "-12229843468425832000", "43998773078572400000"),
      dir = numbers("135756", "0", "110054"),
      isDirectView = true
    )
    val matrix = numbers("6357208618966589712", "-3353649405112903119", "-4306530287245947097") ++
      numbers("3411574935950413602", "3975928620937549823", "578958312146110915") ++
      numbers("3528574910186657953", "4547660689561012311", "-5381418378950176706")
    val offset = numbers("-8992774347053600250", "-6179843817817458089", "-4415726896805374526")
    val angles = Seq.fill(9)(BigInt(0))
    val view   = ViewCase(matrix, offset, 102, -208, angles, numbers("1", "1"), 0)
    val image  = new EnvironmentImage(config, random)
    EnvironmentImage.load(unit.load, unit.clock, config, image.words)
    val answers = check(unit, config, image.words, view, Seq(ray), random, isSlow = false)
    assert(answers.head("steps") > 0, "a ray far away is clipped")
  }
}
