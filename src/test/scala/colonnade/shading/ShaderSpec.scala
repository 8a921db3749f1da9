package colonnade.shading

import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.numbers.StreamTester
import colonnade.{Model, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class ShaderSpec extends AnyFlatSpec with ChiselScalatestTester {
  import AnswerPacking._
  import ShaderPorts._

  behavior of "Shader"

  /** Faster than the interpreter for so wide a unit. */
  private val verilator = Simulation.verilator

  /** The model's answer, of lights that do not shine as well, and what the hit says itself. */
  private def expected(answer: Seq[BigInt], hit: HitQuestion, light: LightQuestion): Seq[BigInt] =
    expected(answer, light, light.albedos(hit.material), hit.context)

  private def expected(answer: Seq[BigInt], light: LightQuestion, albedo: Seq[BigInt], context: Int): Seq[BigInt] =
    answer ++ Seq.fill(4 * (light.sources.size - light.shining))(BigInt(0)) ++ albedo :+ BigInt(context)

  /** Shades hits, a light after another, and compares with the model. */
  private def check(
      shader: Shader,
      config: ColonnadeConfig,
      rounds: Seq[(LightQuestion, Seq[HitQuestion])],
      random: Random,
      stalls: Int => Double = _ => 0
  ): Unit = {
    val questions = rounds.flatMap { case (light, hits) => hits.map(ShaderQuestions.words(_, light)) }
    val answers   = Model.answers(config, questions, "shade").iterator
    for (((light, hits), round) <- rounds.zipWithIndex) {
      var poked                                            = Option.empty[HitQuestion]
      def poke(port: ShadeRequest, hit: HitQuestion): Unit = if (!poked.exists(_ eq hit)) {
        pokeHit(port, hit)
        poked = Some(hit)
      }
      pokeLight(shader.io, light)
      val results =
        StreamTester.exchange(shader.clock, shader.io.request, shader.io.lit, hits)(
          poke,
          peek
        )(random, stalls(round), 400)
      results.zip(hits).foreach { case (result, hit) =>
        val answer = expected(answers.next(), hit, light)
        assert(unpack(result, answer.size) == answer, s"of $hit under $light in ${config.precision}")
      }
    }
  }

  for (config <- TestConfigs.formats) {
    val name = s"${config.precision} and ${config.geometry.vertexBits}-bit vertices"

    it should s"equal the model with $name" in test(new Shader(config)).withAnnotations(verilator) { shader =>
      val random    = new Random(20)
      val questions = new ShaderQuestions(config, random)
      val rounds    = Seq.fill(8) {
        val light = questions.light()
        val hits  = Seq.fill(3)(questions.surfaceHit(light)) :+ questions.anyHit() :+ questions.withoutSmoothNormal()
        light -> random.shuffle(hits)
      }
      val ties = Seq.fill(2)(questions.light().copy(offset = random.nextInt(64)) -> Seq.fill(5)(questions.halfway()))
      check(shader, config, rounds ++ ties ++ extremes(config, questions) ++ atTheLight(questions), random, _ % 2 * 0.7)
    }
  }

  /** Every number at an end of its range. */
  private def extremes(config: ColonnadeConfig, questions: ShaderQuestions): Seq[(LightQuestion, Seq[HitQuestion])] = {
    val most     = (BigInt(1) << (config.numbers.gridBits - 1)) - 1
    val farLight = (BigInt(1) << (config.numbers.macBits.min(config.numbers.sceneBits) - 1)) - 1
    val lowest   = Seq.fill(3)(BigInt(-2048))
    val full     = Seq.fill(3)((BigInt(1) << config.numbers.barycentricBits) - 1)
    for (sign <- Seq(1, -1); isFlat <- Seq(false, true)) yield {
      val light = questions.light().at(Seq.fill(3)(farLight * sign)).copy(
        unitShift = 0,
        offset = (BigInt(1) << (config.numbers.gridBits - 2)) - 1,
        isFlat = isFlat,
        shadows = true
      )
      val corner = questions.anyHit().copy(
        origin = Seq.fill(3)(most * -sign),
        t = most,
        shear = Seq.fill(2)((BigInt(1) << config.numbers.shearFraction) * -sign),
        negative = Seq.fill(3)(sign > 0),
        geometricNormal = lowest,
        normals = Seq.fill(3)(lowest),
        weights = full
      )
      light -> (Seq(false, true).map(side => corner.copy(backSide = side)) :+ questions.withoutNormal())
    }
  }

  /** A surface with the light on it, or right above: there the cosine is one. */
  private def atTheLight(questions: ShaderQuestions): Seq[(LightQuestion, Seq[HitQuestion])] =
    for ((axis, distance) <- Seq(0 -> 77, 1 -> 1, 2 -> 0)) yield {
      val normal = Seq.tabulate(3)(i => BigInt(if (i == axis) 2047 else 0))
      val hit    = questions.anyHit().copy(
        origin = Seq.fill(3)(BigInt(0)),
        t = 0,
        normals = Seq.fill(3)(normal),
        geometricNormal = normal,
        weights = Seq(BigInt(1), BigInt(3), BigInt(0))
      )
      val light = questions.light().at(normal.map(_.signum * distance)).copy(unitShift = 0, offset = 0)
      light -> Seq(hit.copy(backSide = false), hit.copy(backSide = true))
    }

  it should "take a hit with a light at least every 50 cycles at 32b32s64d" in test(new Shader(TestConfigs.tiny)) {
    shader =>
      val random    = new Random(23)
      val questions = new ShaderQuestions(TestConfigs.tiny, random)
      val light     = questions.light().at(Seq(3000, 5000, 9000)).copy(
        shining = 1,
        unitShift = 12,
        isFlat = false,
        shadows = true
      )
      pokeLight(shader.io, light)
      shader.io.request.valid.poke(true)
      shader.io.lit.ready.poke(true)
      val taken = for (_ <- 0 until 20) yield {
        pokeHit(
          shader.io.request.bits,
          questions.surfaceHit(light).copy(weights = Seq(BigInt(1), BigInt(1), BigInt(2)))
        )
        var cycles = 1
        while (!shader.io.request.ready.peekBoolean()) {
          shader.clock.step()
          cycles += 1
        }
        shader.clock.step()
        cycles
      }
      info(s"${taken.sum / taken.size} cycles a hit, at most ${taken.max}")
      assert(taken.max <= 50, s"cycles from a hit to the next: $taken")
  }

  it should "tell the materials of a table apart, whatever its size" in {
    for (materials <- Seq(1, 5, 8)) {
      val config = TestConfigs.tiny.copy(frame = TestConfigs.tiny.frame.copy(materials = materials, maxBounces = 0))
      test(new Shader(config)) { shader =>
        val random    = new Random(24)
        val questions = new ShaderQuestions(config, random)
        val light     = questions.light()
        val hits      = Seq.tabulate(materials)(i => questions.surfaceHit(light).copy(material = i))
        check(shader, config, Seq(light -> hits), random)
      }
    }
  }

  /** Hits come when the shader has promised a cycle before to take one, points of a room as they like.
    *
    * @return what was taken, in order, and what left
    */
  private def mix(
      shader: Shader,
      hits:   Seq[HitQuestion],
      points: Seq[RoomPointQuestion],
      random: Random,
      stalls: Double
  ): (Seq[Either[HitQuestion, RoomPointQuestion]], Seq[BigInt]) = {
    val io                     = shader.io
    val room                   = io.room.get
    var (hitsLeft, pointsLeft) = (hits, points)
    var (isPromised, offers)   = (false, false)
    var (taken, results)       = (Vector.empty[Either[HitQuestion, RoomPointQuestion]], Vector.empty[BigInt])
    var idle                   = 0
    def isWilling              = random.nextDouble() >= stalls
    while (results.size < hits.size + points.size) {
      val comes = isPromised && hitsLeft.nonEmpty && isWilling
      offers = pointsLeft.nonEmpty && (offers || isWilling)
      io.request.valid.poke(comes)
      room.valid.poke(offers)
      if (comes) pokeHit(io.request.bits, hitsLeft.head)
      if (offers) pokePoint(room.bits, pointsLeft.head)
      val accepts = isWilling
      io.lit.ready.poke(accepts)

      idle += 1
      assert(idle < 400, s"nothing leaves after ${results.size} results")
      if (comes) {
        io.request.ready.expect(true, "a promised hit is taken")
        taken :+= Left(hitsLeft.head)
        hitsLeft = hitsLeft.tail
      }
      if (offers && room.ready.peekBoolean()) {
        assert(!comes, "one at a time")
        taken :+= Right(pointsLeft.head)
        pointsLeft = pointsLeft.tail
        offers = false
      }
      if (accepts && io.lit.valid.peekBoolean()) {
        results :+= peek(io.lit.bits)
        idle = 0
      }
      isPromised = io.readyNext.peekBoolean()
      shader.clock.step()
    }
    (taken, results)
  }

  for (config <- TestConfigs.formats.map(_.copy(physicalAttributeMemory = Some(TestConfigs.room))))
    it should s"light points of a room between hits, with ${config.precision} and ${config.geometry.vertexBits}-bit vertices" in
      test(new Shader(config)).withAnnotations(verilator) { shader =>
        val random    = new Random(25)
        val questions = new ShaderQuestions(config, random)
        for (stalls <- Seq(0, 0.3, 0.6, 0.9, 0.5, 0.8)) {
          val light = questions.light().copy(shadows = stalls != 0.5)
          pokeLight(shader.io, light)
          val hits             = Seq.fill(12)(questions.surfaceHit(light))
          val points           = Seq.fill(12)(questions.roomPoint())
          val (taken, results) = mix(shader, hits, points, random, stalls)
          val ofHits           =
            hits.zip(Model.answers(config, hits.map(ShaderQuestions.words(_, light)), "shade")).map {
              case (hit, answer) =>
                Left(hit) -> expected(answer, hit, light)
            }
          val ofPoints =
            points.zip(Model.answers(config, points.map(ShaderQuestions.words(_, light)), "lightroom")).map {
              case (point, answer) => Right(point) -> expected(answer, light, point.albedo, point.context)
            }
          val answers = (ofHits ++ ofPoints).toMap[Either[HitQuestion, RoomPointQuestion], Seq[BigInt]]
          for ((question, result) <- taken.zip(results))
            assert(unpack(result, answers(question).size) == answers(question), s"of $question under $light")
        }
      }
}
