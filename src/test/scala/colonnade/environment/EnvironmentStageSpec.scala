package colonnade.environment

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{EnvironmentView, Load}
import colonnade.shading.EnvironmentSurface
import colonnade.{Model, Packed, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** A stage with its maps; each wide port is one number. */
private class EnvironmentStageHarness(config: ColonnadeConfig) extends Module {
  private val stage = Module(new EnvironmentStage(config))
  private val maps  = Module(new PhysicalAttributeMemory(config, 1, AttributePort.tagBits(config)))

  val io      = IO(chiselTypeOf(stage.io))
  val load    = IO(Flipped(Valid(new Load(config))))
  val view    = IO(Input(UInt(stage.io.view.getWidth.W)))
  val ray     = IO(Input(UInt(stage.io.ray.bits.getWidth.W)))
  val surface = IO(Output(UInt(stage.io.surface.bits.getWidth.W)))
  io :<>= stage.io
  stage.io.view     := view.asTypeOf(stage.io.view)
  stage.io.ray.bits := ray.asTypeOf(stage.io.ray.bits)
  surface           := stage.io.surface.bits.asUInt
  maps.io.load      := load
  SlowMaps.connect(stage.io.maps.get, maps.io.ports.head, isSlow = true.B)
}

class EnvironmentStageSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "EnvironmentStage"

  private val config = TestConfigs.withEnvironment(TestConfigs.environment)

  /** A request. */
  private case class Request(ray: MarchCase, isFresnelReflection: Boolean, isOcclusionTest: Boolean)

  it should "process one request at a time, with the context's last ray, and hold a surface until it is taken" in
    test(new EnvironmentStageHarness(config)).withAnnotations(Simulation.verilator) { dut =>
      val random   = new Random(6)
      val stimulus = new MarchStimulus(config, random)
      val scene    = new EnvironmentScene(config, random)
      val camera   = new stimulus.Camera(scene.focal, scene.middle, isTurned = true)
      val packed   = new Packed(new StoredRay(config))
      val answer   = new Packed(new EnvironmentSurface(config))
      val contexts = config.array.contexts
      dut.clock.setTimeout(0)
      EnvironmentImage.load(dut.load, dut.clock, config, scene.words)
      dut.view.poke(new Packed(new EnvironmentView(config.numbers)).pack(camera.view.fields))

      var rays     = Map.empty[Int, MarchCase]
      var offered  = Option.empty[Request]
      var requests = Vector.empty[Request]
      var found    = Vector.empty[Option[BigInt]] // a surface, or none, in order of time
      var visible  = Vector.empty[Boolean]        // the object's hit is visible
      var distance = Option.empty[BigInt]
      var held     = Option.empty[BigInt]
      var idle     = 0
      while (found.size < 240) {
        // An idle context may get another ray
        val busy = (offered ++ requests.drop(found.size)).map(_.ray.context).toSet
        val free = (0 until contexts).filterNot(busy)
        val next = Option.when(free.nonEmpty && random.nextInt(20) == 0) {
          val ray = if (random.nextInt(3) == 0) stimulus.fromCamera(camera) else stimulus.inRoom(camera)
          ray.copy(context = free(random.nextInt(free.size)))
        }
        dut.io.ray.valid.poke(next.nonEmpty)
        dut.ray.poke(next.fold(BigInt(packed.width, random))(ray =>
          packed.pack(ray.fields - "isDirectView" - "hitDistance")
        ))

        val ready = free.filter(context => rays.contains(context) && !next.exists(_.context == context))
        if (offered.isEmpty && ready.nonEmpty && random.nextInt(4) == 0)
          offered = Some(Request(rays(ready(random.nextInt(ready.size))), random.nextBoolean(), random.nextBoolean()))
        dut.io.hitDistance.poke(distance.getOrElse(BigInt(config.numbers.sceneBits, random)))
        distance = None
        dut.io.req.valid.poke(offered.nonEmpty)
        for (request <- offered) {
          dut.io.req.bits.context.poke(request.ray.context)
          dut.io.req.bits.isDirectView.poke(request.ray.isDirectView)
          dut.io.req.bits.isFresnelReflection.poke(request.isFresnelReflection)
          dut.io.req.bits.isOcclusionTest.poke(request.isOcclusionTest)
        }
        val takes = random.nextInt(8) == 0
        dut.io.surface.ready.poke(takes)

        val surface = Option.when(dut.io.surface.valid.peekBoolean())(dut.surface.peekInt())
        assert(held.isEmpty || held == surface, "a surface stays until it is taken")
        held = surface.filterNot(_ => takes)
        val (isMiss, isVisible) = (dut.io.miss.valid.peekBoolean(), dut.io.visible.valid.peekBoolean())
        assert(Seq(isMiss, isVisible, surface.nonEmpty).count(identity) <= 1)
        if (isMiss || isVisible) found :+= None else if (takes && surface.nonEmpty) found :+= surface
        if (visible.size < found.size) visible :+= isVisible
        if (offered.nonEmpty && dut.io.req.ready.peekBoolean()) {
          assert(requests.size <= found.size, "one request at a time")
          requests ++= offered
          distance = offered.map(_.ray.hitDistance)
          offered = None
          idle = 0
        }
        for (ray <- next) rays += ray.context -> ray
        idle += 1
        assert(idle < 20000, s"no request is taken after ${requests.size}")
        dut.clock.step()
      }

      val words   = requests.take(found.size).map(camera.view.words ++ _.ray.words)
      val answers = Model.attributes(config, scene.words, words, "march").map(MarchCase.answer.zip(_).toMap)
      for (((request, expected), surface) <- requests.zip(answers).zip(found)) {
        val isHit = if (request.isOcclusionTest) expected("hidesObject") == 1 else expected("kind") != HitKind.miss
        assert(surface.nonEmpty == isHit, s"of $request")
        for (bits <- surface) {
          val values = answer.unpack(bits)
          val added  = Map(
            "context" -> BigInt(request.ray.context),
            "shadows" -> BigInt(if (request.isFresnelReflection) 0 else 1)
          )
          assert(values == (expected.filter(value => values.contains(value._1)) ++ added), s"of $request")
        }
      }
      assert(visible == requests.zip(found).map { case (request, hit) => request.isOcclusionTest && hit.isEmpty })
      val tests = requests.zip(found).filter(_._1.isOcclusionTest)
      assert(tests.exists(_._2.isEmpty) && tests.exists(_._2.nonEmpty), "visible and hidden hits")
      assert(requests.zip(found).exists { case (request, hit) =>
        !request.isOcclusionTest && hit.isEmpty
      } && requests.exists(_.isFresnelReflection) && requests.exists(_.ray.isDirectView))
      assert(requests.map(_.ray).distinct.size < requests.size, "a stored ray is requested again")
    }
}
