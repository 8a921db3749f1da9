package colonnade.column

import chisel3._
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.environment.EnvironmentImage
import colonnade.formats.{FrameRegisters, LoadTarget, Pixel}
import colonnade.frame.TileDivider
import colonnade.unit.{SmallEnvironment, SmallFrame, SmallScene}
import colonnade.{Always, Matrix, Packed, Simulation, TestConfigs}
import org.scalatest.Tag
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** A column gives each pixel of its tiles once, equal to the model's, whatever stalls its banks, tiles and pixels. */
class ColumnSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "Column"

  private val (wide, high) = (12, 8)

  /** Probability that a port is ready or valid, seed, shadow rays, environment, and whether it may hide the object. */
  private val rounds =
    Seq((1.0, 1, true, true, false), (0.3, 2, true, true, false), (0.6, 3, false, true, false))
  private val environmentRounds =
    Seq(
      (0.6, 4, true, false, false),
      (0.8, 5, true, true, true),
      (0.3, 6, true, true, true),
      (0.8, 7, true, false, true)
    )

  /** Those of a camera that is not the maps'. */
  private val movedRounds = Seq((0.7, 8, true, true, false), (0.4, 9, true, true, true))

  private def render(name: String, of: ColonnadeConfig, tag: Tag = Always): Unit =
    it should s"give each pixel once, equal to the model's: $name" taggedAs tag in {
      val config = of.copy(
        columnBvhMemory = of.columnBvhMemory.copy(holdable = true),
        frame = of.frame.copy(tileSize = 4)
      )
      test(new ColumnHarness(config)).withAnnotations(Simulation.verilator) { dut =>
        val ofMaps = if (config.hasEnvironment) rounds ++ environmentRounds else rounds
        val all    = ofMaps.map(_ -> true) ++ (if (config.hasEnvironment) movedRounds.map(_ -> false) else Nil)
        // `make test` has each value of each setting
        for (
          ((willing, seed, shadows, hasEnvironment, occlusion), isMapCamera) <- all
          if tag == Matrix || Set(1, 3, 4, 9)(seed)
        ) withClue(s"seed $seed: ") {
          val scene       = new SmallScene(config, seed, wide, high, triangleCount = 15, shadows)
          val environment = Option.when(config.hasEnvironment)(
            new SmallEnvironment(
              config,
              scene,
              new Random(seed),
              Seq(wide, high),
              hasEnvironment,
              occlusion,
              isMapCamera
            )
          )
          // Beside the pixels that show something are a few of the background, in a last tile that is clipped
          val width     = wide + 3
          val registers = environment.fold(scene.registers)(_.registers) ++
            Map[String, BigInt]("frame.width" -> width, "frame.objectRect.x0" -> (if (hasEnvironment) 4 else 0))
          val expected  = new SmallFrame(config, registers, scene.records, (width, high), environment.map(_.words))
          val positions = expected.positions
          val frame     = new ColumnFrame(dut, config, registers, scene.records, environment.map(_.words), seed)
          val pixels    = frame.run(positions.size, willing)
          expected.check(pixels, frame.counts)
          assert(frame.counts("raysPrimary") == positions.size)
          if (occlusion) {
            val bare   = expected.modelled(registers + ("environment.occlusion" -> BigInt(0)))
            val hidden = bare.zip(expected.expected).count { case (a, b) => a("isObject") != b("isObject") }
            assert(expected.hits > 0 && (hidden > 1) == hasEnvironment, "a part of the object is hidden")
          } else expected.checkRays(frame.counts, shadows)
          if (config.hasEnvironment) {
            val isDarker = expected.expected.exists(pixel => Seq("r", "g", "b").exists(c => pixel(s"ratio.$c") < 4096))
            assert(occlusion || isDarker == (hasEnvironment && shadows), "the object takes light from the room")
            assert(
              if (hasEnvironment) frame.counts("raysEnvironment") >= wide * high - expected.hits
              else frame.counts("raysEnvironment") == 0
            )
          }
        }
      }
    }

  private val tiny = TestConfigs.tiny

  private def withPaths(config: ColonnadeConfig, contexts: Int): ColonnadeConfig =
    config.copy(units = config.units.copy(pathContexts = contexts))

  render("no environment, eight paths", withPaths(tiny, 8), Matrix)
  render(
    "an environment, five paths, a ray set-up pipeline", {
      val config = withPaths(TestConfigs.withEnvironment(TestConfigs.environment), 5)
      config.copy(units = config.units.copy(rayInterval = 1))
    },
    Matrix
  )
  render(
    "two rows that share triangle units, pipelines, many paths, corner colours and emission, an environment", {
      val coloured = TestConfigs.withColours.head
      withPaths(coloured, 24).copy(
        array = tiny.array.copy(rows = 2),
        physicalAttributeMemory = Some(TestConfigs.environment),
        frame = coloured.frame.copy(emission = true),
        units = tiny.units.copy(
          marches = 2,
          pathContexts = 24,
          rayInterval = 1,
          shadeInterval = 3,
          triangleRows = 2,
          triangleLanes = 2
        )
      )
    }
  )
  render(
    "an environment, one context, one path, no bounces",
    withPaths(TestConfigs.withPrecision(16, 16, 32), 1).copy(
      array = tiny.array.copy(contexts = 1),
      frame = tiny.frame.copy(lights = 1, maxBounces = 0, hits = false),
      physicalAttributeMemory = Some(TestConfigs.environment)
    ),
    Matrix
  )
}

/** Packs registers and pixel into one port each. */
private class ColumnHarness(config: ColonnadeConfig) extends Module {
  private val column = Module(new Column(config))

  val registers = IO(Input(UInt(new FrameRegisters(config).getWidth.W)))
  val pixel     = IO(Output(UInt(new Pixel(config).getWidth.W)))
  val io        = IO(chiselTypeOf(column.io))
  io :<>= column.io
  column.io.registers := registers.asTypeOf(new FrameRegisters(config))
  pixel               := column.io.pixels.bits.asUInt
}

/** Loads a scene into a column, and gives it all tiles of a frame, in any order. */
private class ColumnFrame(
    dut:       ColumnHarness,
    config:    ColonnadeConfig,
    registers: Map[String, BigInt],
    records:   Seq[BigInt],
    maps:      Option[Map[String, Seq[BigInt]]],
    seed:      Int
) {
  private val random   = new Random(seed)
  private val banks    = config.columnBvhMemory.banks
  private val tileSize = config.frame.tileSize
  private val layout   = new Packed(new Pixel(config))

  // Sums of the column's events
  private val counted = dut.io.events.elements.collect { case (name, event: UInt) => name -> event }.toMap
  private val events  = Seq("raysPrimary", "raysShadow", "raysReflection", "raysRefraction", "hits") ++
    Option.when(config.hasEnvironment)("raysEnvironment")
  val counts = collection.mutable.Map.from(events.map(_ -> 0))

  dut.clock.setTimeout(0)
  dut.registers.poke(new Packed(new FrameRegisters(config)).pack(registers))
  dut.io.progress.isIdle.expect(true)
  dut.io.holds.get.poke(0)
  dut.io.load.valid.poke(true)
  dut.io.load.bits.target.poke(LoadTarget.columnBvh(config))
  for ((record, address) <- records.zipWithIndex) {
    dut.io.load.bits.address.poke(address)
    dut.io.load.bits.record.poke(record)
    dut.clock.step()
  }
  dut.io.load.valid.poke(false)
  maps.foreach(EnvironmentImage.load(dut.io.load, dut.clock, config, _))
  dut.io.start.poke(true)
  dut.clock.step()
  dut.io.start.poke(false)

  /** First pixels of the tiles by kind: of the object, of the environment, of the background. In frames with an
    * environment, those of the object are divided.
    */
  private val Seq(ofObject, ofEnvironment, ofBackground) = {
    val hasEnvironment = registers.get("environment.enabled").contains(BigInt(1))
    val size           = Seq(registers("frame.width").toInt, registers("frame.height").toInt)
    val all            = for (x <- 0 until size(0) by tileSize; y <- 0 until size(1) by tileSize) yield (x, y)
    def meets(rect: String, pixel: (Int, Int), size: Int) = Seq("x" -> pixel._1, "y" -> pixel._2).forall {
      case (axis, first) => registers(s"$rect.${axis}0") < first + size && registers(s"$rect.${axis}1") > first
    }
    val (objects, others) = all.partition(meets("frame.objectRect", _, tileSize))
    val (rooms, rest)     = others.partition(hasEnvironment && meets("environment.window", _, tileSize))
    val first             = 0 until tileSize by TileDivider.edge(config)
    val squares           = for ((x, y) <- objects; dx <- first; dy <- first) yield (x + dx, y + dy)
    val parts = if (hasEnvironment) squares.filter { case (x, y) => x < size(0) && y < size(1) } else objects
    Seq(parts, rooms, rest).map(random.shuffle(_))
  }

  /** @param willing probability that a port is ready or valid, or a bank answers, in a cycle
    * @return positions and values of the pixels in order of time
    */
  def run(pixelCount: Int, willing: Double): Seq[((Int, Int), Map[String, BigInt])] = {
    def isWilling = random.nextDouble() < willing
    val tiles     = Seq(dut.io.tiles.ofObject, dut.io.tiles.ofBackground) ++ dut.io.tiles.ofEnvironment
    val waiting   = Array(ofObject, ofBackground, ofEnvironment)
    val offers    = Array.fill(tiles.size)(false)
    var pixels    = Vector.empty[((Int, Int), Map[String, BigInt])]
    var idle      = 0
    while (pixels.size < pixelCount || idle < 10) {
      dut.io.holds.get.poke((0 until banks).map(bank => if (isWilling) 0 else 1 << bank).sum)
      for ((port, kind) <- tiles.zipWithIndex) {
        if (!offers(kind) && waiting(kind).nonEmpty && isWilling) {
          offers(kind) = true
          port.bits.x.poke(waiting(kind).head._1)
          port.bits.y.poke(waiting(kind).head._2)
        }
        port.valid.poke(offers(kind))
      }
      val accepts = isWilling
      dut.io.pixels.ready.poke(accepts)

      idle += 1
      assert(idle < 8000, s"nothing happens after ${pixels.size} pixels")
      dut.io.events.illegalRecord.expect(false)
      dut.io.events.stackOverflow.expect(false)
      for (name <- events) counts(name) += counted(name).peekInt().toInt
      if (accepts && dut.io.pixels.valid.peekBoolean()) {
        val values = layout.unpack(dut.pixel.peekInt())
        pixels :+= (values("x").toInt, values("y").toInt) -> (values - "x" - "y")
        idle = 0
      }
      for ((port, kind) <- tiles.zipWithIndex if offers(kind) && port.ready.peekBoolean()) {
        waiting(kind) = waiting(kind).tail
        offers(kind) = false
      }
      dut.clock.step()
    }
    dut.io.progress.isDrained.expect(true)
    dut.io.progress.isIdle.expect(true)
    pixels
  }
}
