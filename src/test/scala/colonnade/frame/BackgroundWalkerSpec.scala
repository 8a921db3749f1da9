package colonnade.frame

import chiseltest._
import colonnade.TestConfigs
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class BackgroundWalkerSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "BackgroundWalker"

  for (hits <- Seq(true, false))
    it should s"colour every pixel of clipped tiles once, in Morton order, under stalls, with hits $hits" in {
      val config = TestConfigs.tiny.copy(frame = TestConfigs.tiny.frame.copy(tileSize = 4, hits = hits))
      val size   = (13, 6)
      val tiles  = TileScanSpec.tiles(size, 4)
      val colour = Seq(4095, 17, 2048)
      test(new BackgroundWalker(config)) { dut =>
        dut.io.frame.pixelsWide.poke(size._1)
        dut.io.frame.pixelsHigh.poke(size._2)
        dut.io.colour.channels.zip(colour).foreach { case (port, value) => port.poke(value) }
        for ((willing, seed) <- Seq((1.0, 1), (0.3, 2))) {
          val random  = new Random(seed)
          val visited = TileScanSpec.walk(dut.clock, dut.io.tiles, dut.io.pixels, () => dut.io.isIdle.peekBoolean())(
            tiles,
            () => random.nextDouble() < willing
          ) { pixel =>
            pixel.isObject.expect(false)
            for (hit <- pixel.hit) {
              hit.triangle.expect(0)
              assert(hit.distance.raw.peek().litValue == 0)
            }
            assert(pixel.colour.channels.map(_.peekInt().toInt) == colour)
            (pixel.x.peekInt().toInt, pixel.y.peekInt().toInt)
          }
          assert(visited == tiles.flatMap(TileScanSpec.pixels(size, _, 4)))
        }
      }
    }

  it should "colour pixels of other tiles while those of its own wait" in {
    test(new BackgroundWalker(TileScanSpec.config(tileSize = 8))) { dut =>
      dut.io.frame.pixelsWide.poke(640)
      dut.io.frame.pixelsHigh.poke(480)
      dut.io.colour.g.poke(99)
      dut.io.rejected.ready.poke(true)
      dut.io.tiles.valid.poke(true)
      dut.clock.step()
      dut.io.tiles.valid.poke(false)
      dut.clock.step() // through the queue
      for (x <- 100 until 140) {
        dut.io.others(0).valid.poke(x % 3 > 0)
        dut.io.others(0).bits.x.poke(x)
        dut.io.others(0).bits.y.poke(7)
        dut.io.rejected.valid.expect(x % 3 > 0)
        dut.io.rejected.bits.x.expect(x)
        dut.io.rejected.bits.y.expect(7)
        dut.io.rejected.bits.colour.g.expect(99)
        dut.io.pixels.valid.expect(true)
        dut.io.pixels.bits.x.expect(0)
        dut.clock.step()
      }
    }
  }

  it should "colour pixels of other tiles by their priority, each once" in {
    test(new BackgroundWalker(TestConfigs.withEnvironment(TestConfigs.environment))) { dut =>
      val random = new Random(5)
      val others = dut.io.others
      assert(others.size == 2)
      for (_ <- 0 until 100) {
        val offers = others.map(_ => random.nextBoolean())
        val ready  = random.nextBoolean()
        dut.io.rejected.ready.poke(ready)
        for (((port, offer), source) <- others.zip(offers).zipWithIndex) {
          port.valid.poke(offer)
          port.bits.x.poke(10 + source)
        }
        val first = offers.indexOf(true)
        dut.io.rejected.valid.expect(first >= 0)
        if (first >= 0) dut.io.rejected.bits.x.expect(10 + first)
        for ((port, source) <- others.zipWithIndex if offers(source)) port.ready.expect(ready && source == first)
        dut.clock.step()
      }
    }
  }

  it should "give one pixel per cycle, and be idle before the first and after the last" in {
    val config = TileScanSpec.config(tileSize = 8)
    test(new BackgroundWalker(config)) { dut =>
      dut.io.frame.pixelsWide.poke(640)
      dut.io.frame.pixelsHigh.poke(480)
      dut.io.pixels.ready.poke(true)
      dut.io.isIdle.expect(true)
      dut.io.tiles.valid.poke(true)
      dut.clock.step()
      dut.io.tiles.valid.poke(false)
      dut.clock.step() // through the queue
      for (_ <- 0 until 64) {
        dut.io.pixels.valid.expect(true)
        dut.io.isIdle.expect(false)
        dut.clock.step()
      }
      dut.io.pixels.valid.expect(false)
      dut.io.isIdle.expect(true)
    }
  }
}

class EnvironmentWalkerSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "EnvironmentWalker"

  it should "sort the pixels of clipped tiles by the window, in Morton order, under stalls" in {
    val base   = TestConfigs.withEnvironment(TestConfigs.environment)
    val config = base.copy(frame = base.frame.copy(tileSize = 4))
    val size   = (13, 10)
    val tiles  = TileScanSpec.tiles(size, 4)
    val random = new Random(1)
    test(new EnvironmentWalker(config)) { dut =>
      dut.io.frame.pixelsWide.poke(size._1)
      dut.io.frame.pixelsHigh.poke(size._2)
      for ((isEnabled, (x0, y0, x1, y1)) <- Seq(true -> (2, 3, 11, 9), true -> (5, 5, 5, 9), false -> (0, 0, 13, 10))) {
        dut.io.window.enabled.poke(isEnabled)
        val rect = dut.io.window.rect
        Seq(rect.x0, rect.y0, rect.x1, rect.y1).zip(Seq(x0, y0, x1, y1)).foreach { case (port, to) => port.poke(to) }
        var waiting = tiles
        val taken   = Array.fill(2)(Vector.empty[(Int, Int)])
        while (waiting.nonEmpty || !dut.io.isIdle.peekBoolean()) {
          dut.io.tiles.valid.poke(waiting.nonEmpty)
          for ((x, y) <- waiting.headOption) {
            dut.io.tiles.bits.x.poke(x)
            dut.io.tiles.bits.y.poke(y)
          }
          for ((port, index) <- Seq(dut.io.positions, dut.io.others).zipWithIndex) {
            val ready = random.nextBoolean()
            port.ready.poke(ready)
            if (ready && port.valid.peekBoolean())
              taken(index) :+= (port.bits.x.peekInt().toInt, port.bits.y.peekInt().toInt)
          }
          if (waiting.nonEmpty && dut.io.tiles.ready.peekBoolean()) waiting = waiting.tail
          dut.clock.step()
        }
        val (inside, outside) = tiles.flatMap(TileScanSpec.pixels(size, _, 4)).partition { case (x, y) =>
          isEnabled && x >= x0 && x < x1 && y >= y0 && y < y1
        }
        assert(taken.toSeq == Seq(inside, outside))
      }
    }
  }
}
