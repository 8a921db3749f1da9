package colonnade.frame

import chisel3._
import chisel3.util.DecoupledIO
import chiseltest._
import colonnade.TestConfigs
import colonnade.formats.{FrameSettings, PixelPosition}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** Tiles and their pixels against the outline. Both must be exact: a pixel that meets it is in a tile that does. */
class OutlineTestSpec extends AnyFlatSpec with ChiselScalatestTester {
  private val limit = 1 << TestConfigs.tiny.numbers.coordinateBits

  /** Sends squares with bubbles, accepts results with stalls. */
  private def answers[T](
      clock:   Clock,
      squares: DecoupledIO[PixelPosition],
      tested:  DecoupledIO[TestedSquare],
      isIdle:  Bool,
      random:  Random
  )(sent: Seq[(Int, Int)])(poke: ((Int, Int)) => Unit)(answer: ((Int, Int), Boolean) => T): Seq[T] = {
    var (waiting, answers, cycles) = (sent, Vector.empty[T], 0)
    while (answers.size < sent.size) {
      val offers = waiting.nonEmpty && random.nextInt(4) > 0
      squares.valid.poke(offers)
      if (offers) {
        squares.bits.x.poke(waiting.head._1)
        squares.bits.y.poke(waiting.head._2)
        poke(waiting.head)
      }
      isIdle.expect(sent.size - waiting.size == answers.size)
      val takes = random.nextInt(4) > 0
      tested.ready.poke(takes)
      if (takes && tested.valid.peekBoolean()) {
        val first = (tested.bits.first.x.peekInt().toInt, tested.bits.first.y.peekInt().toInt)
        answers :+= answer(first, tested.bits.meetsObject.peekBoolean())
      }
      if (offers && squares.ready.peekBoolean()) waiting = waiting.tail
      clock.step()
      cycles += 1
      assert(cycles < 20 * sent.size + 20, "every square is answered")
    }
    answers
  }

  for (size <- Seq(8, 32)) {
    val config = TestConfigs.tiny.copy(frame = TestConfigs.tiny.frame.copy(tileSize = size))

    behavior of s"OutlineTest of tiles of $size"

    it should "say which tiles meet it, and how high its edge functions are there, under stalls" in {
      val random = new Random(size)
      test(new OutlineTest(config)) { dut =>
        dut.clock.setTimeout(0)
        for (_ <- 0 until 12) {
          def coordinate() = random.nextInt(limit / size) * size
          val tiles        = Seq.fill(60)((coordinate(), coordinate())) ++
            Seq((0, 0), (limit - size, limit - size), (0, limit - size))
          val outline = Outline.random(random, tiles, limit)
          outline.poke(dut.io.frame)
          val send = answers[Unit](dut.clock, dut.io.tiles, dut.io.tested, dut.io.isIdle, random)(tiles)(_ => ()) _
          var left = tiles
          send { case (tile, meets) =>
            assert(tile == left.head)
            assert(meets == (outline.meets(size) _).tupled(tile))
            if (meets)
              dut.io.tested.bits.edgeValues
                .zip((outline.edgeValues(size) _).tupled(tile))
                .foreach { case (port, value) => port.expect(value) }
            left = left.tail
          }
        }
      }
    }

    behavior of s"PixelTest of tiles of $size"

    it should "say which pixels of tiles that meet it meet it, under stalls" in {
      val random = new Random(size)
      test(new PixelTest(config)) { dut =>
        dut.clock.setTimeout(0)
        var (met, missed) = (0, 0)
        for (_ <- 0 until 24) {
          val near    = Seq.fill(2)(random.nextInt(limit - 2 * size))
          val pixels  = Seq.fill(150)((near(0) + random.nextInt(2 * size), near(1) + random.nextInt(2 * size)))
          val outline = Outline.random(random, pixels, limit)
          val tile    = (pixel: (Int, Int)) => (pixel._1 / size * size, pixel._2 / size * size)
          val sent    = pixels.filter(pixel => (outline.meets(size) _).tupled(tile(pixel)))
          outline.poke(dut.io.frame)
          val found = answers(dut.clock, dut.io.pixels, dut.io.tested, dut.io.isIdle, random)(sent) { pixel =>
            (outline.pokeValues(dut.io.edgeValues, size) _).tupled(pixel)
          }((pixel, meets) => pixel -> meets)
          assert(found == sent.map(pixel => pixel -> (outline.meets(1) _).tupled(pixel)))
          met += found.count(_._2)
          missed += found.count(!_._2)
        }
        assert(met > 200 && missed > 200)
      }
    }
  }
}

/** An outline in a spec: a rectangle (x0, y0, x1, y1) and half-planes a·x + b·y + c ≥ 0. */
final case class Outline(rect: Seq[Int], edges: Seq[(Int, Int, Int)]) {
  def poke(frame: FrameSettings): Unit = {
    val ports = frame.objectRect
    Seq(ports.x0, ports.y0, ports.x1, ports.y1).zip(rect).foreach { case (port, value) => port.poke(value) }
    for ((port, (x, y, offset)) <- frame.objectOutline.zip(edges)) {
      port.x.poke(x)
      port.y.poke(y)
      port.offset.poke(offset)
    }
  }

  /** A pixel of the square is in the rectangle, and for each half-plane one pixel is in it. */
  def meets(size: Int)(x: Int, y: Int): Boolean = {
    val Seq(x0, y0, x1, y1) = rect
    (x until x + size).exists(px => px >= x0 && px < x1) && (y until y + size).exists(py => py >= y0 && py < y1) &&
    highest(size)(x, y).forall(_ >= 0)
  }

  /** The edge functions, each one at the corner of the square where it is highest. */
  private def highest(size: Int)(x: Int, y: Int): Seq[Long] = {
    val corners = for (cx <- Seq(x, x + size - 1); cy <- Seq(y, y + size - 1)) yield (cx, cy)
    edges.map(edge => corners.map { case (cx, cy) => edge._1.toLong * cx + edge._2.toLong * cy + edge._3 }.max)
  }

  /** What [[EdgeValues]] says of a tile that meets the outline. */
  def edgeValues(size: Int)(x: Int, y: Int): Seq[Long] = highest(size)(x, y).map(_.min(4096L * size - 1))

  /** Pokes them for the tile of a pixel. */
  def pokeValues(ports: Vec[UInt], size: Int)(x: Int, y: Int): Unit =
    ports.zip(edgeValues(size)(x / size * size, y / size * size)).foreach { case (port, value) =>
      port.poke(value.max(0))
    }
}

object Outline {
  private val noEdge = (0, 0, 0)

  /** Half of its edges go through one of some pixels, where one step more or less decides; the others cut nothing off.
    */
  def random(random: Random, pixels: Seq[(Int, Int)], limit: Int): Outline = Outline(
    if (random.nextInt(8) == 0) Seq(9, 9, 9, 40)
    else Seq(random.nextInt(64), random.nextInt(64), limit - 9, limit - 1),
    Seq.fill(6) {
      def normal() = if (random.nextInt(8) == 0) -2048 else random.nextInt(4096) - 2048
      val (x, y)   = (normal(), normal())
      val (px, py) = pixels(random.nextInt(pixels.size))
      if (random.nextBoolean()) noEdge else (x, y, -(x * px + y * py) - random.nextInt(2))
    }
  )

  /** An outline that nothing of a frame is outside of, but for one edge. */
  def within(size: (Int, Int), edge: (Int, Int, Int) = noEdge): Outline =
    Outline(Seq(0, 0, size._1, size._2), edge +: Seq.fill(5)(noEdge))
}
