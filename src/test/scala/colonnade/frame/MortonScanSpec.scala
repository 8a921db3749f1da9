package colonnade.frame

import chiseltest._
import colonnade.Properties
import org.scalacheck.{Gen, Prop}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class MortonScanSpec extends AnyFlatSpec with ChiselScalatestTester with Properties {
  behavior of "MortonScan"

  /** Scans grids one after the other; returns the cells of each, and the longest time between two cells of one grid. */
  private def scan(dut: MortonScan, sizes: Seq[(Int, Int)], isReady: () => Boolean): (Seq[(Int, Int)], Int) = {
    var waiting = sizes
    var cells   = Vector.empty[(Int, Int)]
    var gap     = 0
    var longest = 0
    var cycles  = 0
    while (waiting.nonEmpty || !dut.io.isIdle.peekBoolean()) {
      dut.io.size.valid.poke(waiting.nonEmpty)
      waiting.headOption.foreach { case (wide, high) =>
        dut.io.size.bits.wide.poke(wide)
        dut.io.size.bits.high.poke(high)
      }
      dut.io.cells.ready.poke(isReady())
      cycles += 1
      assert(cycles < 50000, "the scan ends")
      gap += 1
      if (dut.io.cells.valid.peekBoolean() && dut.io.cells.ready.peekBoolean()) {
        cells :+= (dut.io.cells.bits.x.peekInt().toInt, dut.io.cells.bits.y.peekInt().toInt)
        longest = longest.max(gap)
      }
      if (dut.io.cells.valid.peekBoolean()) gap = 0
      if (waiting.nonEmpty && dut.io.size.ready.peekBoolean()) {
        waiting = waiting.tail
      }
      dut.clock.step()
    }
    (cells, longest)
  }

  for (levels <- Seq(1, 3)) {
    it should s"visit every grid of up to ${1 << levels} cells a side in Morton order" in {
      val random = new Random(levels)
      val sizes  = for (wide <- 0 to (1 << levels); high <- 0 to (1 << levels)) yield (wide, high)
      test(new MortonScan(levels)) { dut =>
        val (cells, _) = scan(dut, sizes, () => random.nextInt(4) > 0)
        assert(cells == sizes.flatMap { case (wide, high) => Morton.cells(wide, high) })
      }
    }
  }

  it should "visit arbitrary grids one after the other in Morton order, under stalls" in holds(cases = 12) {
    val scans = for {
      levels <- Gen.choose(1, 5)
      side = Gen.chooseNum(0, 1 << levels)
      sizes   <- Gen.resize(4, Gen.nonEmptyListOf(Gen.zip(side, side)))
      willing <- Gen.choose(0.2, 1.0)
    } yield (levels, sizes, willing)
    Prop.forAllNoShrink(scans) { case (levels, sizes, willing) =>
      val random = new Random(1)
      test(new MortonScan(levels)) { dut =>
        dut.clock.setTimeout(0)
        val (cells, _) = scan(dut, sizes, () => random.nextDouble() < willing)
        assert(cells == sizes.flatMap { case (wide, high) => Morton.cells(wide, high) })
      }
      true
    }
  }

  it should "skip cells outside the grid in a few steps" in {
    for ((wide, high) <- Seq((120, 68), (40, 30), (1, 128), (128, 1), (65, 65))) test(new MortonScan(7)) { dut =>
      dut.clock.setTimeout(0)
      val (cells, longest) = scan(dut, Seq((wide, high)), () => true)
      assert(cells == Morton.cells(wide, high))
      assert(longest <= 3 * 7, s"$longest cycles between two cells of $wide x $high")
    }
  }

  it should "start the next grid without a gap" in {
    test(new MortonScan(2)) { dut =>
      dut.io.size.valid.poke(true)
      dut.io.size.bits.wide.poke(4)
      dut.io.size.bits.high.poke(4)
      dut.io.cells.ready.poke(true)
      dut.clock.step()
      for (_ <- 0 until 48) {
        dut.io.cells.valid.expect(true)
        dut.clock.step()
      }
    }
  }
}

/** Morton order, by sorting. */
object Morton {

  /** The cells of a grid in Morton order. */
  def cells(wide: Int, high: Int): Seq[(Int, Int)] =
    (for (x <- 0 until wide; y <- 0 until high) yield (x, y)).sortBy { case (x, y) => code(x, y) }

  private def code(x: Int, y: Int): Long =
    (0 until 16).map(bit => ((x >> bit & 1L) << (2 * bit)) | ((y >> bit & 1L) << (2 * bit + 1))).sum
}
