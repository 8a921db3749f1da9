package colonnade.unit

import chisel3._
import chiseltest._
import colonnade.{Model, TestConfigs}
import colonnade.config.{ColonnadeConfig, UnitsConfig}
import colonnade.formats.{FrameRegisters, Pixel}
import colonnade.traversal.Packed
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

/** One render unit in a column whose memory answers when it likes and whose other rows read what they like. */
class RenderUnitSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "RenderUnit"

  private val (wide, high) = (12, 8)

  private def render(config: ColonnadeConfig, name: String): Unit =
    it should s"give every position once, with the model's pixel: $name" in
      test(new RenderUnitHarness(config)).withAnnotations(Seq(VerilatorBackendAnnotation)) { dut =>
        for ((willing, seed, shadows) <- Seq((1.0, 1, true), (0.3, 2, true), (0.6, 3, false))) {
          val scene     = new SmallScene(config, seed, wide, high, triangleCount = 15, shadows)
          val positions = new Random(seed).shuffle(for (x <- 0 until wide; y <- 0 until high) yield (x, y))
          val column    = new UnitColumn(dut, config, scene, seed)
          val pixels    = column.run(positions, willing)
          val expected  = Model.pixels(config, scene.registers, scene.records, positions)
          val hits      = expected.count(_(3) == 1)

          assert(pixels.map(_._1).sorted == positions.sorted, "every position comes out once")
          val found = pixels.toMap
          for ((position, pixel) <- positions.zip(expected))
            assert(found(position) == pixel.take(found(position).size), s"at $position, seed $seed")
          assert(column.hits == hits)
          assert(
            hits > positions.size / 6 && (if (shadows) column.shadowRays > hits / 8 else column.shadowRays == 0) &&
              (column.bouncedRays > 0) == config.frame.hasBounces,
            "there is something to see"
          )
        }
      }

  render(TestConfigs.tiny, "a tree, contexts that snoop")
  render(
    TestConfigs.tiny.copy(
      units = UnitsConfig(boxLanes = 4, triangleLanes = 2),
      columnBvhMemory = TestConfigs.tiny.columnBvhMemory.copy(recordBuffers = 3)
    ),
    "wide units"
  )
  render(
    TestConfigs.withPrecision(16, 16, 32).copy(
      array = TestConfigs.tiny.array.copy(contexts = 1),
      geometry = TestConfigs.tiny.geometry.copy(bvh = false, trianglesPerRecord = 1),
      columnBvhMemory = TestConfigs.tiny.columnBvhMemory.copy(snooping = false, banks = 1),
      frame = TestConfigs.tiny.frame.copy(hits = false)
    ),
    "no tree, one context, nobody snoops"
  )
  render(
    TestConfigs.tiny.copy(frame = TestConfigs.tiny.frame.copy(lights = 1, maxBounces = 0)),
    "one light, nothing bounces"
  )
}

/** With the registers and each pixel in one port. */
private class RenderUnitHarness(config: ColonnadeConfig) extends Module {
  private val unit = Module(new RenderUnit(config))

  val registers = IO(Input(UInt(new FrameRegisters(config).getWidth.W)))
  val pixel     = IO(Output(UInt(new Pixel(config).getWidth.W)))
  val io        = IO(chiselTypeOf(unit.io))
  io :<>= unit.io
  unit.io.registers := registers.asTypeOf(new FrameRegisters(config))
  pixel             := unit.io.pixels.bits.asUInt
}

/** The column around one unit. */
private class UnitColumn(dut: RenderUnitHarness, config: ColonnadeConfig, scene: SmallScene, seed: Int) {
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

  dut.clock.setTimeout(0)
  dut.registers.poke(new Packed(new FrameRegisters(config)).pack(scene.registers))
  dut.io.row.poke(row)
  dut.io.start.poke(true)
  dut.clock.step()
  dut.io.start.poke(false)

  /** @param willing probability that a port takes or offers something in a cycle
    * @return position and values of the pixels in the order of time
    */
  def run(positions: Seq[(Int, Int)], willing: Double): Seq[((Int, Int), Seq[BigInt])] = {
    def isWilling = random.nextDouble() < willing
    var waiting   = positions
    var pixels    = Vector.empty[((Int, Int), Seq[BigInt])]
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
      }
      val accepts = isWilling
      dut.io.pixels.ready.poke(accepts)

      idle += 1
      assert(idle < 5000, s"nothing happens after ${pixels.size} pixels")
      dut.io.isIdle.expect(positions.size - waiting.size == pixels.size)
      dut.io.events.illegalRecord.expect(false)
      dut.io.events.stackOverflow.expect(false)
      if (dut.io.events.raysShadow.peekBoolean()) shadowRays += 1
      if (dut.io.events.raysReflection.peekBoolean() || dut.io.events.raysRefraction.peekBoolean()) bouncedRays += 1
      if (dut.io.events.hits.peekBoolean()) hits += 1
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

  private def read(bits: BigInt): ((Int, Int), Seq[BigInt]) = {
    val values = layout.unpack(bits)
    val names  = Seq("colour.r", "colour.g", "colour.b", "isObject") ++
      (if (config.frame.hits) Seq("hit.triangle", "hit.distance") else Nil)
    (values("x").toInt, values("y").toInt) -> names.map(values)
  }

  /** What this row has asked for, and what others have: rows read the same scene. */
  private def broadcast(): Unit = for (bank <- 0 until banks) {
    val port = dut.io.broadcasts(bank)
    if (random.nextInt(5) == 0) {
      val address = random.nextInt(scene.records.size) / banks * banks + bank
      if (address < scene.records.size) inFlight(bank).enqueue((now + 1 + random.nextInt(5), address, row + 1))
    }
    val isDue = inFlight(bank).headOption.exists(_._1 <= now)
    port.valid.poke(isDue)
    if (isDue) {
      val (_, address, reader) = inFlight(bank).dequeue()
      port.bits.address.poke(address)
      port.bits.record.poke(scene.records(address))
      port.bits.row.poke(reader)
    }
  }

  private def takeRequest(takes: Boolean): Unit = {
    dut.io.requests.ready.poke(takes)
    if (takes && dut.io.requests.valid.peekBoolean()) {
      val address = dut.io.requests.bits.address.peekInt().toInt
      assert(address < scene.records.size)
      inFlight(address % banks).enqueue((now + 1 + random.nextInt(5), address, row))
    }
  }
}
