package colonnade.shading

import chisel3._
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Rgb, Vec3}
import colonnade.numbers.{Fixed, StreamTester}
import colonnade.{Model, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class ShaderSpec extends AnyFlatSpec with ChiselScalatestTester {
  import AnswerPacking._

  behavior of "Shader"

  /** Faster than the interpreter for so wide a unit. */
  private val verilator = Seq(VerilatorBackendAnnotation)

  private def pokeFixed(port: Fixed, raw: BigInt): Unit = port.raw match {
    case signed: SInt => signed.poke(raw)
    case other        => other.asInstanceOf[UInt].poke(raw)
  }

  private def pokeVector(port: Vec3[Fixed], raw: Seq[BigInt]): Unit =
    port.axes.zip(raw).foreach { case (to, value) => pokeFixed(to, value) }

  private def pokeColour(port: Rgb[UInt], raw: Seq[BigInt]): Unit =
    port.channels.zip(raw).foreach { case (to, value) => to.poke(value) }

  private def pokeLight(io: ShaderIO, light: LightQuestion): Unit = {
    for ((port, source) <- io.lights.zip(light.sources)) {
      port.position.axes.zip(source.position).foreach { case (to, value) => to.poke(value) }
      port.colour.channels.zip(source.colour).foreach { case (to, value) => pokeFixed(to, value) }
      port.reachMantissa.poke(source.reachMantissa)
      port.reachExponent.poke(source.reachExponent)
    }
    io.unitShift.poke(light.unitShift)
    io.shading.offset.poke(light.offset)
    io.shading.lights.poke(light.shining)
    io.shading.flat.poke(light.isFlat)
    io.shading.shadows.poke(light.shadows)
    io.materials.zip(light.albedos).foreach { case (to, value) => pokeColour(to.albedo, value) }
  }

  private def pokeHit(port: ShadeRequest, hit: HitQuestion): Unit = {
    port.context.poke(hit.context)
    port.ray.heading.axis.poke(hit.axis)
    port.ray.heading.negative.zip(hit.negative).foreach { case (to, value) => to.poke(value) }
    port.ray.origin.zip(hit.origin).foreach { case (to, value) => pokeFixed(to, value) }
    port.ray.shear.zip(hit.shear).foreach { case (to, value) => pokeFixed(to, value) }
    pokeFixed(port.hit.t, hit.t)
    port.hit.id.poke(0)
    port.hit.weights.zip(hit.weights).foreach { case (to, value) => pokeFixed(to, value) }
    port.hit.backSide.poke(hit.backSide)
    port.face.normals.zip(hit.normals).foreach { case (to, value) => pokeVector(to, value) }
    pokeVector(port.face.geometricNormal, hit.geometricNormal)
    port.face.material.poke(hit.material)
  }

  private def peek(port: LitSurface): BigInt = pack(
    port.origin.axes.map(_.integer.peekInt()) ++
      port.directs.zip(port.needsShadowRays).flatMap { case (direct, needs) =>
        direct.channels.map(_.natural.peekInt()) :+ needs.peekInt()
      } ++ port.albedo.channels.map(_.peekInt()) :+ port.context.peekInt()
  )

  /** The model's answer, of lights that do not shine as well, and what the hit says itself. */
  private def expected(answer: Seq[BigInt], hit: HitQuestion, light: LightQuestion): Seq[BigInt] =
    answer ++ Seq.fill(4 * (light.sources.size - light.shining))(BigInt(0)) ++ light.albedos(hit.material) :+
      BigInt(hit.context)

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
}
