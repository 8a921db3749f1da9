package colonnade.frame

import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.{Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class TileWalkerSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "TileWalker"

  private def config(tileSize: Int, base: ColonnadeConfig = TestConfigs.tiny): ColonnadeConfig =
    base.copy(frame = base.frame.copy(tileSize = tileSize))

  /** Walks tiles; returns positions in order of time, with whether they are rendered, and the cycles. `meets` is called
    * with the flag of each pixel that is rendered.
    */
  private def walk(
      dut:      TileWalker,
      size:     (Int, Int),
      tileSize: Int,
      tiles:    Seq[(Int, Int)],
      isReady:  Boolean => Boolean,
      edge:     (Int, Int, Int) = (0, 0, 0),
      meets:    ((Int, Int), Boolean) => Unit = (_, _) => ()
  ): (Seq[(Boolean, (Int, Int))], Int) = {
    val outline = Outline.within(size, edge)
    dut.io.frame.pixelsWide.poke(size._1)
    dut.io.frame.pixelsHigh.poke(size._2)
    outline.poke(dut.io.frame)
    var waiting   = tiles
    var positions = Vector.empty[(Boolean, (Int, Int))]
    var cycles    = 0
    while (waiting.nonEmpty || !dut.io.isIdle.peekBoolean()) {
      dut.io.tiles.valid.poke(waiting.nonEmpty)
      waiting.headOption.foreach { case (x, y) =>
        dut.io.tiles.bits.x.poke(x)
        dut.io.tiles.bits.y.poke(y)
        outline.pokeValues(dut.io.tiles.bits.edgeValues, tileSize)(x, y)
      }
      for ((port, isRendered) <- Seq(dut.io.others -> false, dut.io.positions -> true)) {
        val ready = isReady(isRendered)
        port.ready.poke(ready)
        if (ready && port.valid.peekBoolean()) {
          positions :+= isRendered -> (port.bits.x.peekInt().toInt, port.bits.y.peekInt().toInt)
          if (isRendered)
            dut.io.positions.bits.meetsObject.foreach(claim => meets(positions.last._2, claim.peekBoolean()))
        }
      }
      if (waiting.nonEmpty && dut.io.tiles.ready.peekBoolean()) waiting = waiting.tail
      dut.clock.step()
      cycles += 1
      assert(cycles < 50000, "the walk ends")
    }
    (positions, cycles)
  }

  private def pixels(size: (Int, Int), tile: (Int, Int), tileSize: Int): Seq[(Int, Int)] =
    Morton
      .cells((size._1 - tile._1).min(tileSize), (size._2 - tile._2).min(tileSize))
      .map { case (x, y) => (tile._1 + x, tile._2 + y) }

  for (tileSize <- Seq(4, 32)) {
    it should s"walk tiles of $tileSize in Morton order without a gap" in {
      val tiles = Seq((0, 0), (tileSize, 0), (2 * tileSize, 3 * tileSize))
      test(new TileWalker(config(tileSize))).withAnnotations(Simulation.verilator) { dut =>
        dut.clock.setTimeout(0)
        val (positions, cycles) = walk(dut, (640, 480), tileSize, tiles, _ => true)
        assert(positions.map(_._2) == tiles.flatMap(pixels((640, 480), _, tileSize)))
        assert(cycles == 3 * tileSize * tileSize + 5)
      }
    }
  }

  it should "walk on while pixels outside the outline wait" in {
    test(new TileWalker(config(tileSize = 8))) { dut =>
      val tile           = Seq((0, 0))
      val sees           = (pixel: (Int, Int)) => pixel._1 >= 4 // behind the others in Morton order
      var cycle          = 0
      val (positions, _) = walk(
        dut,
        (640, 480),
        8,
        tile,
        isRendered => {
          cycle += 1
          isRendered || cycle > 400
        },
        edge = (1, 0, -4)
      )
      val (rendered, others) = positions.map(_._2).partition(sees)
      assert(positions.map(_._2) == rendered ++ others && others.size == 32)
    }
  }

  for ((hasWindow, claim) <- Seq(false -> "sort out the pixels", true -> "render the room's window, too,"))
    it should s"$claim outside the outline, whichever side is ready" in {
      val random = new Random(3)
      test(new TileWalker(config(tileSize = 8, TestConfigs.withEnvironment(TestConfigs.environment)))) {
        dut =>
          val window = dut.io.window
          window.enabled.poke(hasWindow)
          Seq(window.rect.x0, window.rect.y0, window.rect.x1, window.rect.y1).zip(Seq(2, 3, 12, 15)).foreach {
            case (port, value) => port.poke(value)
          }
          val inWindow = (pixel: (Int, Int)) =>
            hasWindow && pixel._1 >= 2 && pixel._2 >= 3 && pixel._1 < 12 && pixel._2 < 15
          // With a window the object's tiles are divided
          val size  = if (hasWindow) 2 else 8
          val tiles =
            for (first <- Seq(0, 8); y <- 0 until 8 by size; x <- 0 until 8 by size) yield (first + x, first + y)
          var claims         = Map.empty[(Int, Int), Boolean]
          val (positions, _) =
            walk(
              dut,
              (640, 480),
              tileSize = 8,
              tiles,
              isRendered => random.nextInt(if (isRendered) 5 else 3) == 0,
              edge = (3, -2, -9),
              (pixel, meets) => claims += pixel -> meets
            )
          val (rendered, others)  = positions.partition(_._1)
          val expected            = tiles.flatMap(pixels((640, 480), _, size))
          val sees                = (pixel: (Int, Int)) => 3 * pixel._1 - 2 * pixel._2 - 9 >= 0
          val (isTaken, isOthers) = expected.partition(pixel => inWindow(pixel) || sees(pixel))
          assert(rendered.map(_._2) == isTaken)
          assert(others.map(_._2) == isOthers)
          assert(claims == isTaken.map(pixel => pixel -> sees(pixel)).toMap)
          assert(expected.exists(sees) && !expected.forall(sees))
      }
    }

  it should "give every pixel of clipped tiles once" in {
    val random = new Random(2)
    val size   = (21, 10)
    val tiles  = Seq((0, 0), (8, 0), (16, 0), (0, 8), (8, 8), (16, 8))
    test(new TileWalker(config(tileSize = 8))) { dut =>
      val (positions, _) = walk(dut, size, 8, tiles, _ => random.nextInt(5) == 0)
      val expected       = tiles.flatMap(pixels(size, _, 8))
      assert(positions.map(_._2).sorted == expected.sorted)
    }
  }
}
