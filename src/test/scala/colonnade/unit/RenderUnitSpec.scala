package colonnade.unit

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.config.{ColonnadeConfig, MapEncoding}
import colonnade.environment.{AttributePort, EnvironmentImage, EnvironmentMarches, PhysicalAttributeMemory, SlowMaps}
import colonnade.formats.{FrameRegisters, Load, Pixel}
import colonnade.{Always, Matrix, Model, Packed, Simulation, TestConfigs}
import org.scalatest.Tag
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

/** One render unit in a column with random memory latency and random reads of other rows. */
class RenderUnitSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "RenderUnit"

  private val (wide, high) = (12, 8)
  private val names        = Seq("colour.r", "colour.g", "colour.b", "isObject", "hit.triangle", "hit.distance") ++
    Seq("r", "g", "b").map(channel => s"ratio.$channel")

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

  private def render(config: ColonnadeConfig, name: String, tag: Tag = Always): Unit =
    it should s"give each pixel once, equal to the model's: $name" taggedAs tag in
      test(new RenderUnitHarness(config)).withAnnotations(Simulation.verilator) { dut =>
        for (
          (willing, seed, shadows, hasEnvironment, occlusion) <-
            if (config.hasEnvironment) rounds ++ environmentRounds else rounds
        ) {
          val scene       = new SmallScene(config, seed, wide, high, triangleCount = 15, shadows)
          val environment = Option.when(config.hasEnvironment)(
            new SmallEnvironment(config, scene, new Random(seed), Seq(wide, high), hasEnvironment, occlusion)
          )
          val registers = environment.fold(scene.registers)(_.registers)
          val positions = new Random(seed).shuffle(for (x <- 0 until wide; y <- 0 until high) yield (x, y))
          val column    = new UnitColumn(dut, config, registers, scene.records, environment.map(_.words), seed)
          val pixels    = column.run(positions, willing)
          def modelled(registers: Map[String, BigInt]) =
            Model.pixels(config, registers, scene.records, positions, environment.map(_.words)).map(names.zip(_).toMap)
          val expected = modelled(registers)
          val hits     = expected.count(_("isObject") == 1)
          if (occlusion) {
            val bare   = modelled(registers + ("environment.occlusion" -> BigInt(0)))
            val hidden = bare.zip(expected).count { case (bare, pixel) => bare("isObject") != pixel("isObject") }
            val later  = bare.zip(expected).count { case (bare, pixel) =>
              bare("isObject") == pixel("isObject") && bare != pixel
            }
            assert(hits > 0 && (hidden > 1) == hasEnvironment, s"a part of the object is hidden, seed $seed")
            info(s"seed $seed: $hidden pixels hidden, $later with hidden hits of later rays")
          }

          assert(pixels.map(_._1).sorted == positions.sorted, "every position comes out once")
          val found = pixels.toMap
          for ((position, pixel) <- positions.zip(expected))
            assert(
              found(position) == pixel.filter(value => found(position).contains(value._1)),
              s"at $position, seed $seed"
            )
          assert(column.hits == hits)
          assert(
            occlusion || hits > positions.size / 6 && (if (shadows) column.shadowRays > hits / 8
                                                       else column.shadowRays == 0) &&
              (column.bouncedRays > 0) == config.frame.hasBounces,
            "there is something to see"
          )
          if (config.hasEnvironment) {
            val isDarker = expected.exists(pixel => Seq("r", "g", "b").exists(c => pixel(s"ratio.$c") < 4096))
            assert(
              occlusion || isDarker == (hasEnvironment && shadows),
              s"the object takes light from the room, seed $seed"
            )
            assert(if (hasEnvironment) column.roomRays >= positions.size - hits else column.roomRays == 0)
          }
        }
      }

  render(TestConfigs.tiny, "a tree, snooping")
  render(
    TestConfigs.tiny.copy(
      units = TestConfigs.tiny.units.copy(boxLanes = 4, triangleLanes = 2),
      columnBvhMemory = TestConfigs.tiny.columnBvhMemory.copy(recordBuffers = 3)
    ),
    "wide units",
    Matrix
  )
  render(
    TestConfigs.withPrecision(16, 16, 32).copy(
      array = TestConfigs.tiny.array.copy(contexts = 1),
      geometry = TestConfigs.tiny.geometry.copy(bvh = false, trianglesPerRecord = 1),
      columnBvhMemory = TestConfigs.tiny.columnBvhMemory.copy(snooping = false, banks = 1),
      frame = TestConfigs.tiny.frame.copy(hits = false)
    ),
    "no tree, one context, no snooping"
  )
  render(
    TestConfigs.tiny.copy(frame = TestConfigs.tiny.frame.copy(lights = 1, maxBounces = 0)),
    "one light, no bounces",
    Matrix
  )
  render(TestConfigs.tiny.copy(units = TestConfigs.tiny.units.copy(shortPaths = true)), "with short paths")
  render(TestConfigs.withEnvironment(TestConfigs.environment), "with an environment")
  render(
    TestConfigs.withPrecision(16, 16, 32).copy(
      array = TestConfigs.tiny.array.copy(contexts = 1),
      frame = TestConfigs.tiny.frame.copy(lights = 1, maxBounces = 0, hits = false),
      units = TestConfigs.tiny.units.copy(marches = 1),
      physicalAttributeMemory = Some(TestConfigs.environment.copy(encoding = MapEncoding.Sliding))
    ),
    "with an environment, a march of the column, one context, no bounces",
    Matrix
  )
  render(
    TestConfigs.withColours.head.copy(
      units = TestConfigs.tiny.units.copy(marches = 2, directView = true),
      physicalAttributeMemory = Some(TestConfigs.environment),
      frame = TestConfigs.withColours.head.frame.copy(emission = true)
    ),
    s"corner colours and emission at ${TestConfigs.withColours.head.precision} with an environment in the column"
  )
  for (config <- TestConfigs.withColours.tail) {
    val withoutTextures = config.copy(geometry = config.geometry.copy(textureBytes = 0))
    render(withoutTextures, s"corner colours at ${config.precision}", Matrix)
  }
}

/** Packs registers and pixel into one port each; with an environment, adds its maps, with random latency. */
private class RenderUnitHarness(config: ColonnadeConfig) extends Module {
  private val unit = Module(new RenderUnit(config))

  val registers = IO(Input(UInt(new FrameRegisters(config).getWidth.W)))
  val pixel     = IO(Output(UInt(new Pixel(config).getWidth.W)))
  val io        = IO(chiselTypeOf(unit.io))
  io :<>= unit.io
  unit.io.registers := registers.asTypeOf(new FrameRegisters(config))
  pixel             := unit.io.pixels.bits.asUInt

  /** Loads of the maps. */
  val load            = Option.when(config.hasEnvironment)(IO(Flipped(Valid(new Load(config)))))
  private val marches = unit.io.marches.map { port =>
    val marches = Module(new EnvironmentMarches(config)).io
    marches.view := unit.io.registers.environment.get
    marches.units.head :<>= port
    marches.maps
  }
  for (asks <- marches.orElse(unit.io.maps.map(Seq(_)))) {
    val maps = Module(new PhysicalAttributeMemory(config, config.mapRequesters, AttributePort.tagBits(config)))
    asks.zip(maps.io.ports).foreach { case (asks, port) => SlowMaps.connect(asks, port, isSlow = true.B) }
    maps.io.load := load.get
  }
}

/** The column around one unit. */
private class UnitColumn(
    dut:       RenderUnitHarness,
    config:    ColonnadeConfig,
    registers: Map[String, BigInt],
    records:   Seq[BigInt],
    maps:      Option[Map[String, Seq[BigInt]]],
    seed:      Int
) {
  private val random   = new Random(seed)
  private val banks    = config.columnBvhMemory.banks
  private val row      = 0
  private val inFlight = Seq.fill(banks)(mutable.Queue.empty[(Int, Int, Int)]) // (due, address, row)
  private val layout   = new Packed(new Pixel(config))
  private var now      = 0

  /** Events that the unit has reported. */
  var shadowRays  = 0
  var bouncedRays = 0
  var hits        = 0
  var roomRays    = 0

  dut.clock.setTimeout(0)
  dut.registers.poke(new Packed(new FrameRegisters(config)).pack(registers))
  dut.io.row.poke(row)
  for (words <- maps; port <- dut.load) EnvironmentImage.load(port, dut.clock, config, words)
  dut.io.start.poke(true)
  dut.clock.step()
  dut.io.start.poke(false)

  /** @param willing probability that a port is ready or valid in a cycle
    * @return positions and values of the pixels in order of time
    */
  def run(positions: Seq[(Int, Int)], willing: Double): Seq[((Int, Int), Map[String, BigInt])] = {
    def isWilling = random.nextDouble() < willing
    var waiting   = positions
    var pixels    = Vector.empty[((Int, Int), Map[String, BigInt])]
    var offers    = false
    var idle      = 0
    while (pixels.size < positions.size) {
      broadcast()
      takeRequest(isWilling)
      offers = waiting.nonEmpty && (offers || isWilling)
      dut.io.positions.valid.poke(offers)
      for ((x, y) <- waiting.headOption) {
        dut.io.positions.bits.x.poke(x)
        dut.io.positions.bits.y.poke(y)
        dut.io.positions.bits.meetsObject.foreach(_.poke(maySeeObject(x, y)))
      }
      val accepts = isWilling
      dut.io.pixels.ready.poke(accepts)

      idle += 1
      assert(idle < (if (config.hasEnvironment) 30000 else 5000), s"nothing happens after ${pixels.size} pixels")
      dut.io.isIdle.expect(positions.size - waiting.size == pixels.size)
      dut.io.events.illegalRecord.expect(false)
      dut.io.events.stackOverflow.expect(false)
      if (dut.io.events.raysShadow.peekBoolean()) shadowRays += 1
      if (dut.io.events.raysReflection.peekBoolean() || dut.io.events.raysRefraction.peekBoolean()) bouncedRays += 1
      if (dut.io.events.hits.peekBoolean()) hits += 1
      if (dut.io.events.raysEnvironment.exists(_.peekBoolean())) roomRays += 1
      if (accepts && dut.io.pixels.valid.peekBoolean()) {
        pixels :+= read(dut.pixel.peekInt())
        idle = 0
      }
      if (offers && dut.io.positions.ready.peekBoolean()) {
        waiting = waiting.tail
        offers = false
      }
      dut.clock.step()
      now += 1
    }
    dut.io.isIdle.expect(true)
    pixels
  }

  private def read(bits: BigInt): ((Int, Int), Map[String, BigInt]) = {
    val values = layout.unpack(bits)
    (values("x").toInt, values("y").toInt) -> (values - "x" - "y")
  }

  private def maySeeObject(x: Int, y: Int): Boolean =
    Seq("x" -> x, "y" -> y).forall { case (axis, at) =>
      registers(s"frame.objectRect.${axis}0") <= at && at < registers(s"frame.objectRect.${axis}1")
    }

  /** Reads of this row, and of other rows, which read the same scene. */
  private def broadcast(): Unit = for (bank <- 0 until banks) {
    val port = dut.io.broadcasts(bank)
    if (random.nextInt(5) == 0) {
      val address = random.nextInt(records.size) / banks * banks + bank
      if (address < records.size) inFlight(bank).enqueue((now + 1 + random.nextInt(5), address, row + 1))
    }
    val isDue = inFlight(bank).headOption.exists(_._1 <= now)
    port.valid.poke(isDue)
    if (isDue) {
      val (_, address, reader) = inFlight(bank).dequeue()
      port.bits.address.poke(address)
      port.bits.record.poke(records(address))
      port.bits.row.poke(reader)
    }
  }

  private def takeRequest(takes: Boolean): Unit = {
    dut.io.requests.ready.poke(takes)
    if (takes && dut.io.requests.valid.peekBoolean()) {
      val address = dut.io.requests.bits.address.peekInt().toInt
      assert(address < records.size)
      inFlight(address % banks).enqueue((now + 1 + random.nextInt(5), address, row))
    }
  }
}
