package colonnade.frame

import chisel3._
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.{Proofs, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** Sources that number their pixels in y, with their own index in x, and offer and take at any time. */
class PixelCollectorProof(config: ColonnadeConfig) extends Module {
  private val rows = config.array.rows

  val offers = IO(Input(UInt(rows.W)))
  val ready  = IO(Input(Bool()))

  private val collector = Module(new PixelCollector(config))
  private val pixels    = collector.io.pixels
  pixels.ready := ready

  for ((source, row) <- collector.io.sources.zipWithIndex) {
    val (sent, received) = (RegInit(0.U(3.W)), RegInit(0.U(3.W)))
    val isMine           = pixels.bits.x === row.U
    source.valid  := offers(row)
    source.bits   := 0.U.asTypeOf(source.bits)
    source.bits.x := row.U
    source.bits.y := sent
    when(source.fire) { sent := sent + 1.U }
    when(pixels.fire && isMine) { received := received + 1.U }
    assert(!pixels.valid || !isMine || (pixels.bits.y === received && received < sent), "once each, in order")

    val waited = RegInit(0.U(3.W))
    val others = collector.io.sources.map(_.fire).reduce(_ || _)
    when(!source.valid || source.fire) { waited := 0.U }.elsewhen(others) { waited := waited + 1.U }
    assert(waited < rows.U, "no source waits for more than the others")
  }
  assert(!pixels.valid || pixels.bits.x < rows.U, "a pixel from nowhere")
}

class PixelCollectorSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "PixelCollector"

  private def withRows(rows: Int) =
    TestConfigs.tiny.copy(array = TestConfigs.tiny.array.copy(rows = rows), frame = TestConfigs.tiny.frame.copy(hits = false))

  it should "lose, double and starve no pixel" in {
    prove(cycles = 6)(new PixelCollectorProof(withRows(2)))
  }

  for (rows <- Seq(1, 10)) {
    it should s"join $rows streams at one pixel a cycle" in {
      test(new PixelCollector(withRows(rows))) { dut =>
        dut.io.sources.foreach(_.valid.poke(true))
        dut.io.pixels.ready.poke(true)
        dut.io.sources.zipWithIndex.foreach { case (source, row) => source.bits.x.poke(row) }
        dut.clock.step()
        for (i <- 0 until 3 * rows) {
          dut.io.pixels.valid.expect(true)
          dut.io.pixels.bits.x.expect(i % rows)
          dut.clock.step()
        }
      }
    }
  }

  it should "carry every bit under random stalls" in {
    val random = new Random(1)
    test(new PixelCollector(TestConfigs.tiny.copy(array = TestConfigs.tiny.array.copy(rows = 4)))) { dut =>
      val waiting = Array.fill(4)(Seq.fill(50)((random.nextInt(640), random.nextInt(480), random.nextInt(4096))))
      var left    = waiting.flatten.groupBy(identity).view.mapValues(_.length).toMap
      while (left.nonEmpty) {
        val offers = waiting.map(_.nonEmpty && random.nextBoolean())
        for ((source, row) <- dut.io.sources.zipWithIndex) {
          source.valid.poke(offers(row))
          waiting(row).headOption.foreach { case (x, y, colour) =>
            source.bits.x.poke(x)
            source.bits.y.poke(y)
            source.bits.colour.channels.foreach(_.poke(colour))
            source.bits.isObject.poke(colour % 2 == 1)
            source.bits.hit.get.triangle.poke(colour % 512)
          }
        }
        val takes = random.nextInt(3) > 0
        dut.io.pixels.ready.poke(takes)
        if (takes && dut.io.pixels.valid.peekBoolean()) {
          val bits  = dut.io.pixels.bits
          val pixel = (bits.x.peekInt().toInt, bits.y.peekInt().toInt, bits.colour.g.peekInt().toInt)
          bits.isObject.expect(pixel._3 % 2 == 1)
          bits.hit.get.triangle.expect(pixel._3 % 512)
          assert(left.contains(pixel))
          left = if (left(pixel) == 1) left - pixel else left.updated(pixel, left(pixel) - 1)
        }
        for (row <- offers.indices if offers(row) && dut.io.sources(row).ready.peekBoolean()) waiting(row) = waiting(row).tail
        dut.clock.step()
      }
    }
  }
}
