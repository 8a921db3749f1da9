package colonnade

import chiseltest._
import colonnade.column.FakePathTracer
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Pixel, RecordFormats}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** The device with fake path tracers. */
class ColonnadeSpec extends AnyFlatSpec with OneSimulation {
  behavior of "Colonnade"

  private def config(rows: Int, columns: Int, banks: Int, latency: Int): ColonnadeConfig = TestConfigs.tiny.copy(
    array = TestConfigs.tiny.array.copy(rows = rows, columns = columns),
    columnBvhMemory = TestConfigs.tiny.columnBvhMemory.copy(depth = 64, banks = banks, readLatency = latency),
    frame = TestConfigs.tiny.frame.copy(tileSize = 4)
  )

  private def records(config: ColonnadeConfig, seed: Int): Seq[BigInt] = {
    val random = new Random(seed)
    Seq.fill(config.columnBvhMemory.depth)(BigInt(new RecordFormats(config).recordBits, random))
  }

  private def read(pixel: Pixel): ((Int, Int), Int) =
    (pixel.x.peekInt().toInt, pixel.y.peekInt().toInt) -> pixel.colour.g.peekInt().toInt

  private def picture(config: ColonnadeConfig, records: Seq[BigInt], wide: Int, high: Int) =
    (for (x <- 0 until wide; y <- 0 until high) yield (x, y) -> FakePathTracer.colour(config, records, x, y)).toMap

  private def several(configuration: ColonnadeConfig)(dut: Colonnade): Unit = {
    val device = new Device(dut, configuration)
    val random = new Random(configuration.array.rows)
    for (((wide, high), seed) <- Seq((13, 6), (4, 4), (0, 5), (1, 7)).zipWithIndex) {
      val scene = records(configuration, seed)
      device.load(scene)
      device.write("frame.width", wide)
      device.write("frame.objectRect.x1", wide)
      device.write("frame.height", high)
      device.write("frame.objectRect.y1", high)
      device.write("shading.flat", seed % 2)
      val stalls           = seed % 2 == 0
      val (pixels, cycles) = device.frame(() => !stalls || random.nextInt(4) == 0)(read)
      val units            = BigInt(configuration.array.rows * configuration.array.columns)

      assert(pixels.size == wide * high && pixels.toMap == picture(configuration, scene, wide, high))
      assert(device.read("status.done") == 1 && device.read("status.busy") == 0)
      if (pixels.nonEmpty) assert(device.read("counters.cycles") == cycles)
      assert(device.read("counters.raysPrimary") == pixels.size)
      assert(device.read("counters.nodeReads") == FakePathTracer.reads * pixels.size)
      assert(device.read("counters.deepestStack") == (wide - 1).max(0).min(7) * high.min(1))
      val contexts = Seq("waitRecord", "waitUnit", "idleContexts").map(name => device.read(s"counters.$name"))
      assert(contexts.sum == units * device.read("counters.cycles"))
      assert(device.read("errors.illegalRecord") == (if (seed % 2 == 1 && wide > 5 && high > 0) 1 else 0))
      assert(device.read("errors.watchdog") == 0 && device.read("errors.stackOverflow") == 0)
    }
  }

  private def hanging(configuration: ColonnadeConfig)(dut: Colonnade): Unit = {
    val device = new Device(dut, configuration)
    val scene  = records(configuration, 1)
    device.load(scene)
    device.write("frame.width", 10)
    device.write("frame.objectRect.x1", 10)
    device.write("frame.height", 6)
    device.write("frame.objectRect.y1", 6)
    device.write("frame.watchdogCycles", 300)
    for (hangs <- Seq(1, 1, 0)) {
      device.write("shading.shadows", hangs)
      val (pixels, _) = device.frame(() => true)(read)
      assert(device.read("errors.watchdog") == hangs)
      val expected = picture(configuration, scene, 10, 6)
      assert(pixels.toSet.subsetOf(expected.toSet))
      val lost = if (hangs == 1) 1 to 2 else 0 to 0 // the hanging unit's, and the next one in its slot
      assert(lost.contains(60 - pixels.size))
    }
  }

  private def stalled(configuration: ColonnadeConfig)(dut: Colonnade): Unit = {
    val device = new Device(dut, configuration)
    var cycle  = 0
    device.load(records(configuration, 1))
    device.write("frame.width", 4)
    device.write("frame.objectRect.x1", 4)
    device.write("frame.height", 4)
    device.write("frame.objectRect.y1", 4)
    device.write("frame.watchdogCycles", 100)
    val (pixels, cycles) = device.frame { () =>
      cycle += 1
      dut.io.load.ready.expect(false)
      cycle > 1000 * configuration.array.columns
    }(read)
    assert(pixels.size == 16 && cycles > 1000)
    assert(device.read("errors.watchdog") == 0)
    dut.io.load.ready.expect(true)
  }

  for ((rows, columns, banks, latency) <- Seq((1, 1, 1, 1), (3, 2, 2, 1), (2, 3, 4, 4))) {
    val configuration = config(rows, columns, banks, latency)
    val errors        = Seq(
      "end a frame that hangs with an error, and render the next one"    -> hanging(configuration) _,
      "not abort a frame whose sink stalls, nor load while a frame runs" -> stalled(configuration) _
    )
    val tag = Always.unless(rows != 3)
    inOneSimulation(new Colonnade(configuration, new FakePathTracer(_)), tag)(
      (s"render several frames with $rows rows, $columns columns, $banks banks of latency $latency" ->
        several(configuration) _) +: (if (rows == 3) errors else Nil): _*
    )
  }
}
