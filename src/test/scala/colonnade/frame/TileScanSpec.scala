package colonnade.frame

import chiseltest._
import colonnade.TestConfigs
import colonnade.config.ColonnadeConfig
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class TileScanSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "TileScan"

  for (tileSize <- Seq(4, 8, 16))
    it should s"give the pixels of clipped tiles of $tileSize, and of their squares, once, in Morton order, under stalls" in {
      val size   = (2 * tileSize + 3, tileSize + 1)
      val config = TileScanSpec.config(tileSize)
      test(new TileScan(config)) { dut =>
        dut.clock.setTimeout(0)
        dut.io.frame.pixelsWide.poke(size._1)
        dut.io.frame.pixelsHigh.poke(size._2)
        for ((willing, isDivided, seed) <- Seq((1.0, false, 1), (0.3, false, 2), (0.3, true, 3))) {
          val random = new Random(seed)
          val edge   = if (isDivided) TileDivider.edge(config) else tileSize
          val tiles  = TileScanSpec.tiles(size, edge)
          dut.io.isDivided.poke(isDivided)
          val visited = TileScanSpec.walk(dut.clock, dut.io.tiles, dut.io.positions, () => dut.io.isIdle.peekBoolean())(
            tiles,
            () => random.nextDouble() < willing
          )(bits => (bits.x.peekInt().toInt, bits.y.peekInt().toInt))
          assert(visited == tiles.flatMap(TileScanSpec.pixels(size, _, edge)))
        }
      }
    }

  it should "start the next tile without a gap, and be idle after the last" in {
    val config = TileScanSpec.config(tileSize = 4)
    test(new TileScan(config)) { dut =>
      dut.io.frame.pixelsWide.poke(640)
      dut.io.frame.pixelsHigh.poke(480)
      dut.io.positions.ready.poke(true)
      dut.io.isIdle.expect(true)
      dut.io.tiles.valid.poke(true)
      dut.io.tiles.bits.x.poke(32)
      dut.clock.step()
      for (cycle <- 0 until 3 * 16) {
        dut.io.positions.valid.expect(true)
        dut.io.isIdle.expect(false)
        if (cycle == 2 * 16) dut.io.tiles.valid.poke(false)
        dut.clock.step()
      }
      dut.io.positions.valid.expect(false)
      dut.io.isIdle.expect(true)
    }
  }
}

private object TileScanSpec {
  import chisel3._
  import chisel3.util.DecoupledIO

  def config(tileSize: Int): ColonnadeConfig =
    TestConfigs.tiny.copy(frame = TestConfigs.tiny.frame.copy(tileSize = tileSize))

  /** First pixels of the tiles of a frame. */
  def tiles(size: (Int, Int), tileSize: Int): Seq[(Int, Int)] =
    for (y <- 0 until size._2 by tileSize; x <- 0 until size._1 by tileSize) yield (x, y)

  /** Pixels of a tile in Morton order, clipped. */
  def pixels(size: (Int, Int), tile: (Int, Int), tileSize: Int): Seq[(Int, Int)] =
    Morton
      .cells((size._1 - tile._1).min(tileSize), (size._2 - tile._2).min(tileSize))
      .map { case (x, y) => (tile._1 + x, tile._2 + y) }

  /** Sends tiles and accepts results with random stalls on both sides, until the unit is idle.
    *
    * @return the results, read by `peek`
    */
  def walk[O <: Data, T](clock: Clock, in: DecoupledIO[Tile], out: DecoupledIO[O], isIdle: () => Boolean)(
      tiles:     Seq[(Int, Int)],
      isWilling: () => Boolean,
      onAccept:  () => Unit = () => ()
  )(peek: O => T): Seq[T] = {
    var waiting = tiles
    var offers  = false
    var taken   = Vector.empty[T]
    var cycles  = 0
    while (waiting.nonEmpty || !isIdle()) {
      offers = waiting.nonEmpty && (offers || isWilling())
      in.valid.poke(offers)
      for ((x, y) <- waiting.headOption) {
        in.bits.x.poke(x)
        in.bits.y.poke(y)
      }
      val accepts = isWilling()
      out.ready.poke(accepts)
      if (out.valid.peekBoolean()) {
        assert(!isIdle(), "a unit with pixels left is not idle")
        if (accepts) taken :+= peek(out.bits)
      }
      if (offers && in.ready.peekBoolean()) {
        waiting = waiting.tail
        offers = false
        onAccept()
      }
      clock.step()
      cycles += 1
      assert(cycles < 50000, "the walk ends")
    }
    in.valid.poke(false)
    out.valid.expect(false)
    taken
  }
}

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
