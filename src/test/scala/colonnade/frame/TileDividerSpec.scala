package colonnade.frame

import chiseltest._
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class TileDividerSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "TileDivider"

  for (divides <- Seq(true, false))
    it should s"give ${if (divides) "the squares in the frame, in Morton order," else "tiles as they are"} under stalls" in {
      val random = new Random(1)
      test(new TileDivider(TileScanSpec.config(tileSize = 8))) { dut =>
        for (size <- Seq((16, 16), (19, 13), (21, 12), (1, 8))) {
          val tiles = TileScanSpec.tiles(size, 8)
          dut.io.frame.pixelsWide.poke(size._1)
          dut.io.frame.pixelsHigh.poke(size._2)
          dut.io.divides.poke(divides)
          var waiting = tiles
          val parts   = TileScanSpec.walk(dut.clock, dut.io.tiles, dut.io.parts, () => waiting.isEmpty)(
            tiles,
            () => random.nextInt(3) > 0,
            () => waiting = waiting.tail
          )(bits => (bits.x.peekInt().toInt, bits.y.peekInt().toInt))
          assert(parts == (if (divides) tiles.flatMap(squares(size, _)) else tiles))
        }
      }
    }

  private def squares(size: (Int, Int), tile: (Int, Int)): Seq[(Int, Int)] =
    Morton.cells(4, 4).map { case (x, y) => (tile._1 + 2 * x, tile._2 + 2 * y) }.filter { case (x, y) =>
      x < size._1 && y < size._2
    }
}
