package colonnade.bus

import chiseltest._
import colonnade.TestConfigs
import colonnade.config.ShellConfig
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** Pixels of any order become rows; [[FramebufferWriterSpec]] covers rows that leave early. */
class RowBufferSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "RowBuffer"

  private val tile   = 8
  private val config = TestConfigs.tiny.copy(frame = TestConfigs.tiny.frame.copy(tileSize = tile, hits = false))

  it should "take a pixel in every cycle, of one row or of several in turn" in
    test(new RowBuffer(config, ShellConfig(busBytes = 16, rows = 8))) { dut =>
      val random = new Random(5)
      dut.out.ready.poke(true)
      for (y <- 0 until 40 by 4) {
        val pixels       = for (dy <- 0 until 4; x <- 0 until tile) yield (x, y + dy)
        var rows         = Map.empty[Int, Seq[Int]]
        def take(): Unit = {
          if (dut.out.valid.peekBoolean()) {
            dut.out.bits.mask.expect((1 << tile) - 1)
            rows += dut.out.bits.y.peekInt().toInt -> dut.out.bits.pixels.map(_.peekInt().toInt)
          }
          dut.clock.step()
        }
        for ((x, y) <- if (y % 8 == 0) pixels else random.shuffle(pixels)) {
          dut.pixels.valid.poke(true)
          dut.pixels.bits.x.poke(x)
          dut.pixels.bits.y.poke(y)
          dut.pixels.bits.data.poke(100 * y + x)
          dut.pixels.ready.expect(true)
          take()
        }
        dut.pixels.valid.poke(false)
        for (_ <- 0 until 20) take()
        assert(rows == (y until y + 4).map(y => y -> (0 until tile).map(100 * y + _)).toMap)
        dut.isIdle.expect(true)
      }
    }

  it should "join each pixel to the row before it, in all of its rows" in
    test(new RowBuffer(config, ShellConfig(busBytes = 16, rows = 8))) { dut =>
      for (y <- 0 until 8; x <- 0 until 2) {
        dut.pixels.valid.poke(true)
        dut.pixels.bits.x.poke(x)
        dut.pixels.bits.y.poke(y)
        dut.pixels.ready.expect(true)
        dut.clock.step()
      }
      dut.pixels.valid.poke(false)
      dut.out.ready.poke(true)
      dut.flush.poke(true)
      val masks = (0 until 60).flatMap { _ =>
        val row = Option.when(dut.out.valid.peekBoolean())(dut.out.bits.y.peekInt() -> dut.out.bits.mask.peekInt())
        dut.clock.step()
        row
      }
      assert(masks.sorted == (0 until 8).map(y => BigInt(y) -> BigInt(3)))
    }
}
