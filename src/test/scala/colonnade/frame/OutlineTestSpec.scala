package colonnade.frame

import chiseltest._
import colonnade.TestConfigs
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class OutlineTestSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "OutlineTest"

  private val config = TestConfigs.tiny
  private val limit  = 1 << config.numbers.coordinateBits

  private type Edge = (Int, Int, Int)

  private def isInside(edge: Edge)(x: Int, y: Int): Boolean = edge._1.toLong * x + edge._2.toLong * y + edge._3 >= 0

  /** A pixel of the square is in the rectangle, and for each half-plane one pixel is in it. */
  private def meets(rect: Seq[Int], edges: Seq[Edge], size: Int)(x: Int, y: Int): Boolean = {
    val corners             = for (cx <- Seq(x, x + size - 1); cy <- Seq(y, y + size - 1)) yield (cx, cy)
    val Seq(x0, y0, x1, y1) = rect
    (x until x + size).exists(px => px >= x0 && px < x1) && (y until y + size).exists(py => py >= y0 && py < y1) &&
    edges.forall(edge => corners.exists { case (cx, cy) => isInside(edge)(cx, cy) })
  }

  private def frame(dut: OutlineTest, rect: Seq[Int], edges: Seq[Edge]): Unit = {
    val ports = dut.io.frame.objectRect
    Seq(ports.x0, ports.y0, ports.x1, ports.y1).zip(rect).foreach { case (port, value) => port.poke(value) }
    for ((port, (x, y, offset)) <- dut.io.frame.objectOutline.zip(edges)) {
      port.x.poke(x)
      port.y.poke(y)
      port.offset.poke(offset)
    }
  }

  /** Sends squares with bubbles, accepts results with stalls. */
  private def answers(dut: OutlineTest, squares: Seq[(Int, Int)], random: Random): Seq[((Int, Int), Boolean)] = {
    var (sent, answers, cycles) = (0, Vector.empty[((Int, Int), Boolean)], 0)
    while (answers.size < squares.size) {
      val offers = sent < squares.size && random.nextInt(4) > 0
      dut.io.squares.valid.poke(offers)
      if (offers) {
        dut.io.squares.bits.x.poke(squares(sent)._1)
        dut.io.squares.bits.y.poke(squares(sent)._2)
      }
      dut.io.isIdle.expect(sent == answers.size)
      val takes = random.nextInt(4) > 0
      dut.io.tested.ready.poke(takes)
      if (takes && dut.io.tested.valid.peekBoolean()) {
        val first = dut.io.tested.bits.first
        answers :+= (first.x.peekInt().toInt, first.y.peekInt().toInt) -> dut.io.tested.bits.meetsObject.peekBoolean()
      }
      if (offers && dut.io.squares.ready.peekBoolean()) sent += 1
      dut.clock.step()
      cycles += 1
      assert(cycles < 20 * squares.size + 20, "every square is answered")
    }
    answers
  }

  for (size <- Seq(1, 8)) it should s"test squares of $size against rectangle and outline, under stalls" in {
    val random = new Random(size)
    test(new OutlineTest(config, size)) { dut =>
      dut.clock.setTimeout(0)
      for (round <- 0 until 12) {
        def coordinate(limit: Int) = random.nextInt(limit / size) * size
        val squares                = Seq.fill(60)((coordinate(limit), coordinate(limit))) ++
          Seq((0, 0), (limit - size, limit - size), (0, limit - size))
        val rect =
          if (round == 0) Seq(9, 9, 9, 40) else Seq(random.nextInt(64), random.nextInt(64), limit - 9, limit - 1)
        val edges = Seq.fill(6) {
          val (x, y) = (random.nextInt(4096) - 2048, random.nextInt(4096) - 2048)
          if (random.nextBoolean()) (0, 0, 0)
          else { // through one of the squares' first pixels, where one step more or less decides
            val (px, py) = squares(random.nextInt(squares.size))
            (x, y, -(x * px + y * py) - random.nextInt(2))
          }
        }
        frame(dut, rect, edges)
        val expected = squares.map { case (x, y) => (x, y) -> meets(rect, edges, size)(x, y) }
        assert(answers(dut, squares, random) == expected)
      }
    }
  }
}
