package colonnade.frame

import chiseltest._
import colonnade.TestConfigs
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

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
