package colonnade.ray

import chisel3._
import chisel3.util.log2Ceil
import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.formats.Vec3
import colonnade.{Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

/** Expected values straight from docs/numbers.md, section 1. */
class RayGeneratorSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  import RayGeneratorSpec._

  behavior of "RayGenerator"

  TestConfigs.formats.foreach { formats =>
    val name = s"${formats.precision} with ${formats.geometry.vertexBits}-bit vertices"

    it should s"send every pixel's exact ray under random stalls, $name" in {
      test(new RayGenerator(formats)).withAnnotations(Simulation.verilator) { generator =>
        val random = new Random(1)
        for (frame <- frames(formats, random)) {
          setRegisters(generator, frame)
          run(generator, pixels(formats, random, 12), random)(frame)
          run(generator, tileWithGaps(formats, random), random)(frame)
          run(generator, backwards(formats, random), random)(frame)
          // Then the registers change, even if the next pixel would follow the last one
          stop(generator, RayGenerator.emptyCycles)
        }
      }
    }
  }

  it should "forget the registers when it is empty" in {
    val config = TestConfigs.tiny
    test(new RayGenerator(config)) { generator =>
      val random = new Random(2)
      val pixels = tile(config, random)
      for ((frame, pixel) <- frames(config, random).zip(pixels)) {
        setRegisters(generator, frame)
        run(generator, Seq(pixel), random)(frame)
        stop(generator, RayGenerator.emptyCycles)
      }
    }
  }

  it should "accept a pixel of a tile every cycle, after the first one" in {
    val config = TestConfigs.tiny
    test(new RayGenerator(config)) { generator =>
      val pixels = tile(config, new Random(3))
      generator.io.position.valid.poke(true)
      generator.io.ray.ready.poke(true)
      var taken = Seq.empty[Int]
      for (cycle <- 0 until 200 if taken.size < pixels.size) {
        poke(generator, pixels(taken.size))
        if (generator.io.position.ready.peekBoolean()) taken :+= cycle
        generator.clock.step()
      }
      val intervals = taken.zip(taken.tail).map { case (one, next) => next - one }
      // The second pixel waits for the direction of the first one
      intervals.head should be <= config.numbers.coordinateBits + 1
      all(intervals.tail) should be <= 1
      taken.size should be > 20
    }
  }

  it should "take a cycle for each pixel that is left out, but no more than for a pixel alone" in {
    val config = TestConfigs.tiny
    val alone  = config.numbers.coordinateBits + 1
    test(new RayGenerator(config)) { generator =>
      val pixels = tile(config, new Random(3))
      generator.io.position.valid.poke(true)
      generator.io.ray.ready.poke(true)
      for (step <- Seq(1, 2, alone - 1, alone, alone + 1, 2 * alone)) withClue(s"every ${step}th pixel: ") {
        val kept  = pixels.grouped(step).map(_.head).toSeq
        var taken = Seq.empty[Int]
        for (cycle <- 0 until 2 * alone * pixels.size if taken.size < kept.size) {
          poke(generator, kept(taken.size))
          if (generator.io.position.ready.peekBoolean()) taken :+= cycle
          generator.clock.step()
        }
        taken.size shouldBe kept.size
        val intervals = taken.zip(taken.tail).map { case (one, next) => next - one }
        all(intervals.tail) shouldBe step.min(alone)
      }
    }
  }

  it should "send every pixel's exact ray of two mixed tiles under random stalls" in {
    val config = TestConfigs.withEnvironment(TestConfigs.environment)
    test(new RayGenerator(config)).withAnnotations(Simulation.verilator) { generator =>
      val random = new Random(4)
      for (frame <- frames(config, random)) {
        setRegisters(generator, frame)
        for (tiles <- Seq.fill(4)(Seq.fill(2)(tileWithGaps(config, random))))
          run(generator, mixed(tiles, random), random)(frame)
        stop(generator, RayGenerator.emptyCycles)
      }
    }
  }

  it should "forget the registers of both tiles when it is empty" in {
    val config = TestConfigs.withEnvironment(TestConfigs.environment)
    test(new RayGenerator(config)) { generator =>
      val random = new Random(6)
      val tiles  = Seq(true, false).map(isObject => tile(config, random).map(_.copy(inObjectTile = isObject)))
      for (((frame, pixels), index) <- frames(config, random).zip(tiles.transpose).zipWithIndex) {
        setRegisters(generator, frame)
        // The second pixel follows one of the frame before, whose tile was the first then
        run(generator, if (index % 2 == 0) pixels else pixels.reverse, random)(frame)
        stop(generator, RayGenerator.emptyCycles)
      }
    }
  }

  it should "accept a pixel of two mixed tiles every cycle, after the first ones" in {
    val config = TestConfigs.withEnvironment(TestConfigs.environment)
    test(new RayGenerator(config)) { generator =>
      val random = new Random(5)
      val pixels = mixed(Seq.fill(2)(tile(config, random)), random)
      generator.io.position.valid.poke(true)
      generator.io.ray.ready.poke(true)
      var (sent, cycles) = (0, 0)
      while (sent < pixels.size) {
        poke(generator, pixels(sent))
        if (generator.io.position.ready.peekBoolean()) sent += 1
        generator.clock.step()
        cycles += 1
      }
      cycles should be <= pixels.size + 2 * (config.numbers.coordinateBits + 1)
    }
  }

  private def run(generator: RayGenerator, pixels: Seq[Pixel], random: Random)(frame: Frame): Unit = {
    var (sent, received, cycle) = (0, 0, 0)
    while (received < pixels.size) {
      cycle should be < 100 * pixels.size
      val offers  = sent < pixels.size && random.nextInt(3) > 0
      val accepts = random.nextInt(3) > 0
      generator.io.position.valid.poke(offers)
      generator.io.ray.ready.poke(accepts)
      // Bits without valid must have no effect
      val offered = if (offers) pixels(sent) else pixels(random.nextInt(pixels.size))
      poke(generator, offered)
      if (accepts && generator.io.ray.valid.peekBoolean()) {
        expect(generator.io.ray.bits, pixels(received), frame)
        generator.io.pixel.x.expect(pixels(received).x)
        generator.io.pixel.y.expect(pixels(received).y)
        received += 1
      }
      if (offers && generator.io.position.ready.peekBoolean()) sent += 1
      generator.clock.step()
      cycle += 1
    }
  }

  private def poke(generator: RayGenerator, pixel: Pixel): Unit = {
    generator.io.position.bits.context.poke(pixel.context)
    generator.io.position.bits.x.poke(pixel.x)
    generator.io.position.bits.y.poke(pixel.y)
    generator.io.position.bits.inObjectTile.foreach(_.poke(pixel.inObjectTile))
  }

  /** Leaves the empty generator without a pixel. */
  private def stop(generator: RayGenerator, cycles: Int): Unit = {
    generator.io.position.valid.poke(false)
    generator.clock.step(cycles)
  }

  private def expect(ray: RayRequest, pixel: Pixel, frame: Frame): Unit = {
    ray.context.expect(pixel.context)
    ray.isShadow.expect(false)
    for (axis <- 0 until 3) {
      val dir = (frame.dir(axis) << frame.stepShift) + frame.stepX(axis) * pixel.x + frame.stepY(axis) * pixel.y
      ray.dir.axes(axis).peekInt() shouldBe dir
      ray.origin.axes(axis).raw.asInstanceOf[SInt].peekInt() shouldBe (frame.position(axis) << frame.unitShift)
    }
  }
}

object RayGeneratorSpec {
  private type Vector = Seq[BigInt]
  private case class Pixel(context: Int, x: BigInt, y: BigInt, inObjectTile: Boolean = true)
  private case class Frame(
      position:  Vector,
      dir:       Vector,
      stepX:     Vector,
      stepY:     Vector,
      stepShift: Int,
      unitShift: Int
  )

  /** The extremes of all registers, then random ones. */
  private def frames(config: ColonnadeConfig, random: Random): Seq[Frame] = {
    val numbers                          = config.numbers
    val least                            = -(BigInt(1) << (numbers.macBits - 1))
    val most                             = -least - 1
    def vector(value: => BigInt): Vector = Seq.fill(3)(value)
    def any(bits:     Int): BigInt       = BigInt(bits, random) - (BigInt(1) << (bits - 1))
    val maxShift                         = numbers.coordinateBits
    Seq(least, most).map(v =>
      Frame(vector(v), vector(v), vector(v), vector(v), maxShift, numbers.maxUnitShift)
    ) ++
      Seq.fill(4) {
        val unitShift = random.nextInt(numbers.maxUnitShift + 1)
        val position  = vector(any(numbers.macBits.min(numbers.sceneBits - unitShift)))
        def steps     = vector(any(numbers.macBits))
        Frame(position, steps, steps, steps, random.nextInt(maxShift + 1), unitShift)
      }
  }

  private def pixels(config: ColonnadeConfig, random: Random, count: Int): Seq[Pixel] = {
    val bits = config.numbers.coordinateBits
    val corners: Seq[BigInt] = Seq(0, (BigInt(1) << bits) - 1)
    val extreme = for (x <- corners; y <- corners) yield Pixel(1, x, y)
    extreme ++ Seq.fill(count)(Pixel(
      random.nextInt(config.units.pathContexts),
      BigInt(bits, random),
      BigInt(bits, random)
    ))
  }

  /** The pixels of a tile in Morton order. */
  private def tile(config: ColonnadeConfig, random: Random): Seq[Pixel] = {
    val levels                          = log2Ceil(config.frame.tileSize)
    val corner                          = Seq.fill(2)(BigInt(config.numbers.coordinateBits - levels, random) << levels)
    def bits(code: Int, from: Int): Int = (0 until levels).map(level => (code >> (2 * level + from) & 1) << level).sum
    (0 until 1 << 2 * levels).map { code =>
      Pixel(random.nextInt(config.units.pathContexts), corner(0) + bits(code, 0), corner(1) + bits(code, 1))
    }
  }

  /** The same, but some pixels and runs of pixels are left out, and some moved to a tile beside it. */
  private def tileWithGaps(config: ColonnadeConfig, random: Random): Seq[Pixel] = {
    val size = BigInt(config.frame.tileSize)
    val runs = tile(config, random).grouped(3).flatMap { run =>
      run.take(if (random.nextInt(4) == 0) 0 else run.size)
    }
    runs.toSeq.flatMap { pixel =>
      random.nextInt(16) match {
        case 0 => None
        case 1 => Some(pixel.copy(x = pixel.x ^ size))
        case 2 => Some(pixel.copy(y = pixel.y ^ size))
        case _ => Some(pixel)
      }
    }
  }

  /** From the last pixels of a tile to its first ones. */
  private def backwards(config: ColonnadeConfig, random: Random): Seq[Pixel] = {
    val pixels = tile(config, random)
    pixels.takeRight(2) ++ pixels.take(2)
  }

  /** The pixels of two tiles, mixed at random: in turns, and in runs. */
  private def mixed(tiles: Seq[Seq[Pixel]], random: Random): Seq[Pixel] = {
    val isObjects = random.shuffle(tiles.zip(Seq(true, false)).flatMap { case (tile, isObject) =>
      tile.map(_ => isObject)
    })
    val left = tiles.map(_.iterator)
    isObjects.map(isObject => left(if (isObject) 0 else 1).next().copy(inObjectTile = isObject))
  }

  private def setRegisters(generator: RayGenerator, frame: Frame): Unit = {
    val camera                                  = generator.io.registers.camera
    def set(port: Vec3[SInt], to: Vector): Unit = port.axes.zip(to).foreach { case (p, v) => p.poke(v) }
    set(camera.position, frame.position)
    set(camera.dir, frame.dir)
    set(camera.stepX, frame.stepX)
    set(camera.stepY, frame.stepY)
    camera.stepShift.poke(frame.stepShift)
    generator.io.registers.unitShift.poke(frame.unitShift)
  }
}
