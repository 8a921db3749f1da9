package colonnade.shading

import chiseltest._
import colonnade.config.{ColonnadeConfig, UnitsConfig}
import colonnade.numbers.StreamTester
import colonnade.{Always, Matrix, Model, Simulation, TestConfigs}
import org.scalatest.Tag
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class ShaderSpec extends AnyFlatSpec with ChiselScalatestTester {
  import ResultPacking._
  import ShaderDriver._

  behavior of "Shader"

  /** Faster than the interpreter for wide units. */
  private val verilator = Simulation.verilator

  /** The model's results of hits: origin and lights, zeros for lights that are off, albedo and context. */
  private def expected(config: ColonnadeConfig, light: LightCase, hits: Seq[HitCase]): Seq[Seq[BigInt]] = {
    val answers = Model.answers(config, hits.map(ShaderStimulus.words(_, light)), "shade")
    val colours = Model.answers(config, hits.map(ShaderStimulus.colourWords), "cornercolour")
    hits.zip(answers).zip(colours).map { case ((hit, answer), colour) =>
      val albedo =
        if (light.textured(hit.material)) ShaderHarness.texel(colour)
        else if (light.cornerColoured(hit.material)) colour
        else light.albedos(hit.material)
      expected(answer, light, albedo, hit.context)
    }
  }

  private def expected(answer: Seq[BigInt], light: LightCase, albedo: Seq[BigInt], context: Int): Seq[BigInt] =
    answer ++ Seq.fill(4 * (light.sources.size - light.shining))(BigInt(0)) ++ albedo :+ BigInt(context)

  /** Compares shaded hits with the model, one light after another. */
  private def check(
      shader: ShaderHarness,
      config: ColonnadeConfig,
      rounds: Seq[(LightCase, Seq[HitCase])],
      random: Random,
      stalls: Int => Double = _ => 0
  ): Unit = {
    for (((light, hits), round) <- rounds.zipWithIndex) {
      pokeLight(shader.io, light)
      val results =
        StreamTester.exchange(shader.clock, shader.io.request, shader.io.lit, hits)(
          pokeHit,
          peek
        )(random, stalls(round), 400)
      for (((hit, result), answer) <- hits.zip(results).zip(expected(config, light, hits))) {
        assert(unpack(result, answer.size) == answer, s"of $hit under $light in ${config.precision}")
      }
    }
  }

  for (
    config <-
      TestConfigs.formats ++ TestConfigs.withColours ++
        (TestConfigs.formats ++ TestConfigs.withColours).map(TestConfigs.withPipelines) :+ TestConfigs.withExtraSlices(
          TestConfigs.tiny
        )
  ) {
    val name = nameOf(config)

    it should s"equal the model with $name" taggedAs tag(config) in
      test(new ShaderHarness(config)).withAnnotations(verilator) { shader =>
        val random   = new Random(20)
        val stimulus = new ShaderStimulus(config, random)
        val rounds   = Seq.fill(8) {
          val light = stimulus.light()
          val hits  = Seq.fill(3)(stimulus.surfaceHit(light)) :+ stimulus.anyHit() :+ stimulus.withoutSmoothNormal()
          light -> random.shuffle(hits)
        }
        val ties = Seq.fill(2)(stimulus.light().copy(offset = random.nextInt(64)) -> Seq.fill(5)(stimulus.halfway()))
        check(shader, config, rounds ++ ties ++ extremes(config, stimulus) ++ atTheLight(stimulus), random, _ % 2 * 0.7)
      }
  }

  /** [[ShadingPipelineSpec]] covers other formats of the pipeline. */
  private def tag(config: ColonnadeConfig): Tag = {
    val common = Seq(TestConfigs.withPipelines(TestConfigs.tiny), TestConfigs.withTextures)
    if (common.contains(config.copy(physicalAttributeMemory = None))) Always
    else if (isPipeline(config) || config.geometry.cornerColours) Matrix
    else Always.ifExtreme(config)
  }

  /** The widest operands, and each option that takes the shader's time. */
  private def slowest: Seq[ColonnadeConfig] = {
    val wide     = TestConfigs.withPrecision(64, 64, 64)
    val coloured = wide.copy(geometry = wide.geometry.copy(cornerColours = true))
    Seq(TestConfigs.withExtraSlices(wide), coloured)
  }

  private def isPipeline(config: ColonnadeConfig) =
    config.units.shadeInterval < UnitsConfig.sequentialShadeInterval

  private def nameOf(config: ColonnadeConfig): String =
    s"${config.precision} and ${config.geometry.vertexBits}-bit vertices" +
      (if (config.geometry.cornerColours) " with corner colours" else "") +
      (if (config.geometry.texture.nonEmpty) " and textures" else "") +
      (if (isPipeline(config)) " in a pipeline" else "") +
      (if (config.units.extraSlices) " with extra slices" else "")

  /** Every number at a limit of its range. */
  private def extremes(config: ColonnadeConfig, stimulus: ShaderStimulus): Seq[(LightCase, Seq[HitCase])] = {
    val most     = (BigInt(1) << (config.numbers.gridBits - 1)) - 1
    val farLight = (BigInt(1) << (config.numbers.macBits.min(config.numbers.sceneBits) - 1)) - 1
    val lowest   = Seq.fill(3)(BigInt(-2048))
    val full     = Seq.fill(3)((BigInt(1) << config.numbers.barycentricBits) - 1)
    for (sign <- Seq(1, -1); isFlat <- Seq(false, true)) yield {
      val light = stimulus.light().at(Seq.fill(3)(farLight * sign)).copy(
        unitShift = 0,
        offset = (BigInt(1) << (config.numbers.gridBits - 2)) - 1,
        isFlat = isFlat,
        shadows = true
      )
      val corner = stimulus.anyHit().copy(
        origin = Seq.fill(3)(most * -sign),
        t = most,
        shear = Seq.fill(2)((BigInt(1) << config.numbers.shearFraction) * -sign),
        negative = Seq.fill(3)(sign > 0),
        geometricNormal = lowest,
        normals = Seq.fill(3)(lowest),
        weights = full
      )
      light -> (Seq(false, true).map(side => corner.copy(backSide = side)) :+ stimulus.withoutNormal())
    }
  }

  /** A light on the surface, or right above it, where the cosine is one. */
  private def atTheLight(stimulus: ShaderStimulus): Seq[(LightCase, Seq[HitCase])] =
    for ((axis, distance) <- Seq(0 -> 77, 1 -> 1, 2 -> 0)) yield {
      val normal = Seq.tabulate(3)(i => BigInt(if (i == axis) 2047 else 0))
      val hit    = stimulus.anyHit().copy(
        origin = Seq.fill(3)(BigInt(0)),
        t = 0,
        normals = Seq.fill(3)(normal),
        geometricNormal = normal,
        weights = Seq(BigInt(1), BigInt(3), BigInt(0))
      )
      val light = stimulus.light().at(normal.map(_.signum * distance)).copy(unitShift = 0, offset = 0)
      light -> Seq(hit.copy(backSide = false), hit.copy(backSide = true))
    }

  for ((config, limit) <- Seq(TestConfigs.tiny -> 50, TestConfigs.withColours.head -> 60))
    it should s"take a hit with a light at least every $limit cycles at ${nameOf(config)}" in
      test(new ShaderHarness(config)).withAnnotations(verilator) { shader =>
        val random   = new Random(23)
        val stimulus = new ShaderStimulus(config, random)
        val light    = stimulus.light().at(Seq(3000, 5000, 9000)).copy(
          cornerColoured = Seq.fill(config.frame.materials)(config.geometry.cornerColours),
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
            stimulus.surfaceHit(light).copy(weights = Seq(BigInt(1), BigInt(1), BigInt(2)))
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
        assert(taken.max <= limit, s"cycles from a hit to the next: $taken")
      }

  // Without textures: a texel may come at any time
  for (config <- (TestConfigs.formats ++ TestConfigs.withColours.init ++ slowest).distinct)
    it should s"take any hit with a light within ${config.units.shadeInterval} cycles at ${nameOf(config)}" taggedAs
      (if (slowest.contains(config)) Always else Matrix) in
      test(new ShaderHarness(config)).withAnnotations(verilator) { shader =>
        assert(shader.leaf == "SequentialShader")
        val random   = new Random(26)
        val stimulus = new ShaderStimulus(config, random)
        shader.io.lit.ready.poke(true)
        var longest = 0
        for (round <- 0 until 40) {
          val plain = if (round % 2 == 0) stimulus.light() else stimulus.typicalLight()
          val light = plain.copy(shining = 1, isFlat = false)
          pokeLight(shader.io, light)
          for (hit <- Seq.fill(8)(stimulus.surfaceHit(light)) :+ stimulus.withoutSmoothNormal() :+ stimulus.anyHit()) {
            shader.io.request.valid.poke(true)
            pokeHit(shader.io.request.bits, hit)
            var cycles = 1
            while (!shader.io.request.ready.peekBoolean()) {
              shader.clock.step()
              cycles += 1
            }
            shader.clock.step()
            longest = longest.max(cycles)
          }
          shader.io.request.valid.poke(false)
          shader.clock.step(config.units.shadeInterval * 3)
        }
        info(s"at most $longest cycles")
        assert(longest <= config.units.shadeInterval)
      }

  it should "tell the materials of a table apart, whatever its size" in {
    for (materials <- Seq(1, 5, 8)) {
      val config = TestConfigs.tiny.copy(frame = TestConfigs.tiny.frame.copy(materials = materials, maxBounces = 0))
      test(new ShaderHarness(config)).withAnnotations(verilator) { shader =>
        val random   = new Random(24)
        val stimulus = new ShaderStimulus(config, random)
        val light    = stimulus.light()
        val hits     = Seq.tabulate(materials)(i => stimulus.surfaceHit(light).copy(material = i))
        check(shader, config, Seq(light -> hits), random)
      }
    }
  }

  /** Offers hits after cycles with `readyNext`, and points of an environment at any time.
    *
    * @return what was taken, in order, and the results
    */
  private def mix(
      shader: ShaderHarness,
      hits:   Seq[HitCase],
      points: Seq[EnvironmentPointCase],
      random: Random,
      stalls: Double
  ): (Seq[Either[HitCase, EnvironmentPointCase]], Seq[BigInt]) = {
    val io                     = shader.io
    val environment            = io.environment.get
    var (hitsLeft, pointsLeft) = (hits, points)
    var (isPromised, offers)   = (false, false)
    var (taken, results)       = (Vector.empty[Either[HitCase, EnvironmentPointCase]], Vector.empty[BigInt])
    var idle                   = 0
    def isWilling              = random.nextDouble() >= stalls
    while (results.size < hits.size + points.size) {
      val comes = isPromised && hitsLeft.nonEmpty && isWilling
      offers = pointsLeft.nonEmpty && (offers || isWilling)
      io.request.valid.poke(comes)
      environment.valid.poke(offers)
      if (comes) pokeHit(io.request.bits, hitsLeft.head)
      if (offers) pokePoint(environment.bits, pointsLeft.head)
      val accepts = isWilling
      io.lit.ready.poke(accepts)

      idle += 1
      assert(idle < 400, s"nothing leaves after ${results.size} results")
      if (comes) {
        io.request.ready.expect(true, "a promised hit is taken")
        taken :+= Left(hitsLeft.head)
        hitsLeft = hitsLeft.tail
      }
      if (offers && environment.ready.peekBoolean()) {
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

  for (
    config <- (TestConfigs.formats ++ Seq(
      TestConfigs.withTextures,
      TestConfigs.withPipelines(TestConfigs.tiny),
      TestConfigs.withPipelines(TestConfigs.withTextures)
    )).map(_.copy(physicalAttributeMemory = Some(TestConfigs.environment)))
  )
    it should s"light points of an environment between hits, with ${nameOf(config)}" taggedAs tag(config) in
      test(new ShaderHarness(config)).withAnnotations(verilator) { shader =>
        val random   = new Random(25)
        val stimulus = new ShaderStimulus(config, random)
        for (stalls <- Seq(0, 0.3, 0.6, 0.9, 0.5, 0.8)) {
          val light = stimulus.light().copy(shadows = stalls != 0.5)
          pokeLight(shader.io, light)
          val hits             = Seq.fill(12)(stimulus.surfaceHit(light))
          val points           = Seq.fill(12)(stimulus.environmentPoint())
          val (taken, results) = mix(shader, hits, points, random, stalls)
          val ofHits   = hits.zip(expected(config, light, hits)).map { case (hit, answer) => Left(hit) -> answer }
          val ofPoints =
            points.zip(Model.answers(config, points.map(ShaderStimulus.words(_, light)), "lightenvironment")).map {
              case (point, answer) => Right(point) -> expected(answer, light, point.albedo, point.context)
            }
          val answers = (ofHits ++ ofPoints).toMap[Either[HitCase, EnvironmentPointCase], Seq[BigInt]]
          for ((hit, result) <- taken.zip(results))
            assert(unpack(result, answers(hit).size) == answers(hit), s"of $hit under $light")
        }
      }
}
