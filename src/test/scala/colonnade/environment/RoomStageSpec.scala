package colonnade.environment

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Load, RoomView}
import colonnade.shading.RoomSurface
import colonnade.{Model, Packed, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** A stage with its maps; wide ports in one number each. */
private class RoomStageHarness(config: ColonnadeConfig) extends Module {
  private val stage = Module(new RoomStage(config))
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
  SlowMaps.connect(stage.io.maps, maps.io.ports.head, isSlow = true.B)
}

class RoomStageSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "RoomStage"

  private val config = TestConfigs.withRoom(TestConfigs.room)

  /** A question that was taken. */
  private case class Asked(ray: MarchQuestion, isAside: Boolean)

  it should "answer one question at a time, of the context's last ray, and hold a surface until it is taken" in
    test(new RoomStageHarness(config)).withAnnotations(Simulation.verilator) { dut =>
      val random    = new Random(6)
      val questions = new MarchQuestions(config, random)
      val scene     = new RoomScene(config, random)
      val camera    = new questions.Camera(scene.focal, scene.middle, isTurned = true)
      val packed    = new Packed(new RememberedRay(config))
      val answer    = new Packed(new RoomSurface(config))
      val contexts  = config.array.contexts
      dut.clock.setTimeout(0)
      RoomImage.load(dut.load, dut.clock, config, scene.words)
      dut.view.poke(new Packed(new RoomView(config.numbers)).pack(camera.view.fields))

      var rays    = Map.empty[Int, MarchQuestion]
      var offered = Option.empty[Asked]
      var asked   = Vector.empty[Asked]
      var found   = Vector.empty[Option[BigInt]] // a surface, or nothing, in the order of time
      var held    = Option.empty[BigInt]
      var idle    = 0
      while (found.size < 120) {
        // Contexts that wait for nothing may get another ray
        val busy = (offered ++ asked.drop(found.size)).map(_.ray.context).toSet
        val free = (0 until contexts).filterNot(busy)
        val next = Option.when(free.nonEmpty && random.nextInt(20) == 0) {
          val ray = if (random.nextInt(3) == 0) questions.fromCamera(camera) else questions.inRoom(camera)
          ray.copy(context = free(random.nextInt(free.size)))
        }
        dut.io.ray.valid.poke(next.nonEmpty)
        dut.ray.poke(next.fold(BigInt(packed.width, random))(ray => packed.pack(ray.fields - "isSeen")))

        val ready = free.filter(context => rays.contains(context) && !next.exists(_.context == context))
        if (offered.isEmpty && ready.nonEmpty && random.nextInt(4) == 0)
          offered = Some(Asked(rays(ready(random.nextInt(ready.size))), random.nextBoolean()))
        dut.io.question.valid.poke(offered.nonEmpty)
        for (question <- offered) {
          dut.io.question.bits.context.poke(question.ray.context)
          dut.io.question.bits.isSeen.poke(question.ray.isSeen)
          dut.io.question.bits.isAside.poke(question.isAside)
        }
        val takes = random.nextInt(8) == 0
        dut.io.surface.ready.poke(takes)

        val surface = Option.when(dut.io.surface.valid.peekBoolean())(dut.surface.peekInt())
        assert(held.isEmpty || held == surface, "a surface stays until it is taken")
        held = surface.filterNot(_ => takes)
        val isNothing = dut.io.nothing.valid.peekBoolean()
        assert(!isNothing || surface.isEmpty)
        if (isNothing) found :+= None else if (takes && surface.nonEmpty) found :+= surface
        if (offered.nonEmpty && dut.io.question.ready.peekBoolean()) {
          assert(asked.size <= found.size, "one question at a time")
          asked ++= offered
          offered = None
          idle = 0
        }
        for (ray <- next) rays += ray.context -> ray
        idle += 1
        assert(idle < 20000, s"no question is taken after ${asked.size}")
        dut.clock.step()
      }

      val words   = asked.take(found.size).map(camera.view.words ++ _.ray.words)
      val answers = Model.attributes(config, scene.words, words, "march").map(MarchQuestion.answer.zip(_).toMap)
      for (((question, expected), surface) <- asked.zip(answers).zip(found)) {
        assert(surface.isEmpty == (expected("kind") == RoomKind.nothing), s"of $question")
        for (bits <- surface) {
          val values = answer.unpack(bits)
          val told = Map("context" -> BigInt(question.ray.context), "shadows" -> BigInt(if (question.isAside) 0 else 1))
          assert(values == (expected.filter(value => values.contains(value._1)) ++ told), s"of $question")
        }
      }
      assert(found.exists(_.isEmpty) && asked.exists(_.isAside) && asked.exists(_.ray.isSeen))
      assert(asked.map(_.ray).distinct.size < asked.size, "a ray is asked for again")
    }
}
