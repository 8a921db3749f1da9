package colonnade.frame

import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.{OneSimulation, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class FrameControllerSpec extends AnyFlatSpec with OneSimulation {
  behavior of "FrameController"

  private val columns  = 3
  private val tileSize = 8
  private val noTiles  = Vector.empty[(Int, Int)]
  private val config   = withColumns(TestConfigs.tiny)

  private def withColumns(base: ColonnadeConfig) = base.copy(array = base.array.copy(columns = columns))

  /** A model of a column with random time per tile, or one that is stuck. */
  private final class FakeColumn(dut: FrameController, index: Int, random: Random) {
    var isStuck            = false
    var tiles              = Vector.empty[(Int, Int)]
    var others             = Map(TileKind.OfEnvironment -> noTiles, TileKind.OfBackground -> noTiles)
    private var left       = 0
    private val otherPorts =
      dut.io.tiles(index).ofEnvironment.map(TileKind.OfEnvironment -> _).toMap +
        (TileKind.OfBackground -> dut.io.tiles(index).ofBackground)

    /** Drives the ports of this cycle; returns whether a pixel retires. */
    def drive(): Boolean = {
      val port    = dut.io.tiles(index).ofObject
      val retires = left > 0 && !isStuck
      port.ready.poke(left == 0)
      otherPorts.values.foreach(_.ready.poke(random.nextBoolean()))
      dut.io.progress(index).isDrained.poke(left == 0 || (left == 1 && retires))
      dut.io.progress(index).isIdle.poke(left == 0)
      retires
    }

    def step(): Unit = {
      val port = dut.io.tiles(index).ofObject
      for ((kind, other) <- otherPorts if other.ready.peekBoolean() && other.valid.peekBoolean())
        others += kind -> (others(kind) :+ (other.bits.x.peekInt().toInt, other.bits.y.peekInt().toInt))
      if (dut.io.aborts.peekBoolean()) left = 0
      else if (left > 0 && !isStuck) left -= 1
      else if (port.ready.peekBoolean() && port.valid.peekBoolean()) {
        tiles :+= (port.bits.x.peekInt().toInt, port.bits.y.peekInt().toInt)
        left = 1 + random.nextInt(20)
      }
    }
  }

  private final class Bench(dut: FrameController) {
    val random                       = new Random(3)
    var stalls                       = false
    var isMemoryIdle: Int => Boolean = _ => true // by cycle of the frame
    var cycle                        = 0
    var aborts                       = 0
    var timeouts                     = 0
    var starts                       = 0
    var running                      = 0
    var columns                      = Seq.empty[FakeColumn]

    /** Runs one frame; returns its cycles, or none if it does not end within `limit`.
      *
      * @param rect the object's rectangle: x0, y0, x1, y1; the frame by default
      */
    def frame(
        wide:     Int,
        high:     Int,
        watchdog: Int,
        stuck:    Option[Int] = None,
        limit:    Int = 5000,
        rect:     Option[(Int, Int, Int, Int)] = None
    ): Option[Int] = {
      dut.io.frame.pixelsWide.poke(wide)
      dut.io.frame.pixelsHigh.poke(high)
      val (x0, y0, x1, y1) = rect.getOrElse((0, 0, wide, high))
      dut.io.frame.objectRect.x0.poke(x0)
      dut.io.frame.objectRect.y0.poke(y0)
      dut.io.frame.objectRect.x1.poke(x1)
      dut.io.frame.objectRect.y1.poke(y1)
      dut.io.frame.watchdogCycles.poke(watchdog)
      columns = dut.io.tiles.indices.map(new FakeColumn(dut, _, random))
      stuck.foreach(columns(_).isStuck = true)
      cycle = 0
      aborts = 0
      timeouts = 0
      starts = 0
      running = 0
      dut.io.start.poke(true)
      step()
      dut.io.start.poke(false)
      dut.io.status.done.expect(false)
      (1 to limit).find { _ =>
        step()
        dut.io.status.done.peekBoolean()
      }
    }

    private def step(): Unit = {
      val retires = columns.map(_.drive()).reduce(_ || _)
      dut.io.traffic.retires.poke(retires)
      dut.io.traffic.stalls.poke(stalls)
      dut.io.memoryIsIdle.poke(isMemoryIdle(cycle))
      cycle += 1
      if (dut.io.memoryTimeout.peekBoolean()) timeouts += 1
      if (dut.io.frameStart.peekBoolean()) starts += 1
      if (dut.io.aborts.peekBoolean()) aborts += 1
      if (dut.io.isRunning.peekBoolean()) running += 1
      columns.foreach(_.step())
      dut.clock.step()
    }

    def expectTiles(
        wide:           Int,
        high:           Int,
        isObjects:      ((Int, Int)) => Boolean = _ => true,
        isEnvironments: ((Int, Int)) => Boolean = _ => false,
        isDivided:      Boolean = false
    ): Unit = {
      val tiles =
        Morton
          .cells((wide + tileSize - 1) / tileSize, (high + tileSize - 1) / tileSize)
          .map { case (x, y) => (x * tileSize, y * tileSize) }
      val (objects, others)           = tiles.partition(isObjects)
      val (environments, backgrounds) = others.partition(isEnvironments)
      val parts = if (isDivided) Morton.cells(4, 4).map { case (x, y) => (2 * x, 2 * y) } else Seq((0, 0))
      expectDealt(
        objects.flatMap { case (x, y) => parts.map(part => (x + part._1, y + part._2)) },
        columns.map(_.tiles)
      )
      expectDealt(environments, columns.map(_.others(TileKind.OfEnvironment)))
      expectDealt(backgrounds, columns.map(_.others(TileKind.OfBackground)))
    }

    private def expectDealt(expected: Seq[(Int, Int)], dealt: Seq[Seq[(Int, Int)]]): Unit = {
      assert(dealt.flatten.sorted == expected.sorted)
      dealt.foreach(tiles => assert(tiles == expected.filter(tiles.contains(_)), "Morton order"))
    }
  }

  inOneSimulation(new FrameController(config))(
    "dispatch every tile of several frames once, in Morton order" -> { dut =>
      dut.clock.setTimeout(0)
      val bench = new Bench(dut)
      for ((wide, high) <- Seq((64, 48), (1, 1), (60, 9), (8, 100), (8, 8))) {
        assert(bench.frame(wide, high, watchdog = 0).nonEmpty)
        bench.expectTiles(wide, high)
        dut.io.watchdogError.expect(false)
        dut.io.status.busy.expect(false)
        assert(bench.aborts == 0)
      }
    },
    "dispatch tiles outside the object's rectangle to the background" -> { dut =>
      dut.clock.setTimeout(0)
      val bench = new Bench(dut)
      for (
        (x0, y0, x1, y1) <-
          Seq((8, 8, 16, 16), (9, 7, 10, 8), (0, 0, 0, 0), (15, 40, 17, 48), (63, 0, 64, 48), (5, 5, 5, 9))
      ) {
        assert(bench.frame(64, 48, watchdog = 0, rect = Some((x0, y0, x1, y1))).nonEmpty)
        val pixels = for (x <- x0 until x1; y <- y0 until y1) yield (x / tileSize * tileSize, y / tileSize * tileSize)
        bench.expectTiles(64, 48, pixels.toSet)
      }
    },
    "end a frame without pixels at once" -> { dut =>
      val bench = new Bench(dut)
      for ((wide, high) <- Seq((0, 0), (0, 8), (8, 0))) {
        assert(bench.frame(wide, high, watchdog = 0).exists(_ < 10))
        bench.expectTiles(0, 0)
      }
    },
    "dispatch tiles to ready columns without a pause" -> { dut =>
      dut.io.frame.pixelsWide.poke(64)
      dut.io.frame.pixelsHigh.poke(64)
      dut.io.frame.objectRect.x1.poke(64)
      dut.io.frame.objectRect.y1.poke(64)
      dut.io.memoryIsIdle.poke(true)
      dut.io.tiles.foreach(_.ofObject.ready.poke(true))
      dut.io.start.poke(true)
      dut.clock.step()
      dut.io.start.poke(false)
      dut.clock.step(3)
      for (_ <- 0 until 64) {
        assert(dut.io.tiles.count(_.ofObject.valid.peekBoolean()) == 1)
        dut.clock.step()
      }
      assert(dut.io.tiles.count(_.ofObject.valid.peekBoolean()) == 0)
    },
    "abort a frame that hangs, with an error that the next start clears" -> { dut =>
      dut.clock.setTimeout(0)
      val bench = new Bench(dut)
      for (stuck <- 0 until columns) {
        assert(bench.frame(32, 32, watchdog = 100, stuck = Some(stuck)).exists(_ < 800))
        assert(bench.aborts == 1)
        dut.io.watchdogError.expect(true)
        // Each pixel that retires starts the watchdog again
        assert(bench.frame(64, 64, watchdog = 100).exists(_ > 150))
        dut.io.watchdogError.expect(false)
        bench.expectTiles(64, 64)
      }
    },
    "end although the memory is silent, and start no frame before it is idle" -> { dut =>
      dut.clock.setTimeout(0)
      val bench = new Bench(dut)
      // The frame is aborted, and ends after as many cycles again
      bench.isMemoryIdle = _ == 0
      assert(bench.frame(32, 32, watchdog = 100, stuck = Some(1)).exists(cycles => cycles > 200 && cycles < 900))
      assert((bench.starts, bench.aborts, bench.timeouts) == ((1, 1, 1)))
      dut.io.watchdogError.expect(true)
      // The next one does not begin
      bench.isMemoryIdle = _ => false
      assert(bench.frame(32, 32, watchdog = 100).exists(cycles => cycles >= 100 && cycles < 110))
      assert((bench.starts, bench.aborts, bench.timeouts) == ((0, 0, 1)))
      dut.io.watchdogError.expect(true)
      // With late answers it begins late
      bench.isMemoryIdle = _ >= 50
      assert(bench.frame(32, 32, watchdog = 100).nonEmpty)
      assert((bench.starts, bench.aborts, bench.timeouts) == ((1, 0, 0)))
      dut.io.watchdogError.expect(false)
      bench.expectTiles(32, 32)
    },
    "not end without a watchdog" -> { dut =>
      dut.clock.setTimeout(0)
      val bench = new Bench(dut)
      assert(bench.frame(16, 16, watchdog = 0, stuck = Some(1), limit = 600).isEmpty)
    },
    "not end while the sink stalls" -> { dut =>
      dut.clock.setTimeout(0)
      val bench = new Bench(dut)
      bench.stalls = true
      assert(bench.frame(16, 16, watchdog = 50, stuck = Some(1), limit = 600).isEmpty)
    },
    "ignore a start while a frame runs" -> { dut =>
      dut.io.frame.pixelsWide.poke(8)
      dut.io.frame.pixelsHigh.poke(8)
      dut.io.memoryIsIdle.poke(true)
      dut.io.start.poke(true)
      dut.io.frameStart.expect(true)
      for (_ <- 0 until 10) {
        dut.clock.step()
        dut.io.frameStart.expect(false)
        dut.io.status.busy.expect(true)
      }
    }
  )

  it should "dispatch the tiles of the environment's window apart from the object's, which are divided" in {
    test(
      new FrameController(withColumns(TestConfigs.withEnvironment(TestConfigs.environment)))
    ).withAnnotations(Simulation.verilator) { dut =>
      dut.clock.setTimeout(0)
      val bench  = new Bench(dut)
      val window = dut.io.window
      for ((hasWindow, right, tiles) <- Seq((true, 64, 47), (false, 64, 0), (true, 17, 17))) {
        window.enabled.poke(hasWindow)
        window.rect.x0.poke(0)
        window.rect.y0.poke(0)
        window.rect.x1.poke(right)
        window.rect.y1.poke(48)
        assert(bench.frame(64, 48, watchdog = 0, rect = Some((9, 9, 15, 15))).nonEmpty)
        bench.expectTiles(64, 48, _ == (8, 8), tile => hasWindow && tile._1 < right, isDivided = hasWindow)
        assert(bench.columns.map(_.others(TileKind.OfEnvironment).size).sum == tiles)
      }
    }
  }
}
