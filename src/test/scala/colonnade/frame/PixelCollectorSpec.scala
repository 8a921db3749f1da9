package colonnade.frame

import chisel3._
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.{Proofs, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** Two sources that offer and a sink that accepts at any time. It observes one pixel, any that is accepted while
  * `marks` is set, until it leaves.
  */
class PixelCollectorProof(config: ColonnadeConfig) extends Module {
  val offers = IO(Input(Vec(2, Bool())))
  val xs     = IO(Input(Vec(2, UInt(4.W))))
  val ready  = IO(Input(Bool()))
  val marks  = IO(Input(Bool()))

  private val collector = Module(new PixelCollector(config, 2))
  private val sources   = collector.io.sources
  private val pixels    = collector.io.pixels
  pixels.ready := ready
  for ((source, row) <- sources.zipWithIndex) {
    source.valid  := offers(row)
    source.bits   := 0.U.asTypeOf(source.bits)
    source.bits.x := xs(row)
  }
  private val accepts = sources.map(_.fire).reduce(_ || _)
  private val held    = RegInit(0.U(2.W))
  held := held + accepts - pixels.fire
  assert(!sources.map(_.fire).reduce(_ && _), "one pixel at a time")
  assert(pixels.valid === (held =/= 0.U), "every pixel leaves")
  assert(accepts === (offers.reduce(_ || _) && held =/= 2.U), "no pixel is put off without a cause")
  assert(!sources(1).fire || !offers(0), "the first source goes first")

  private val follows = RegInit(false.B)
  private val ahead   = Reg(UInt(2.W))
  private val x       = Reg(UInt(4.W))
  when(marks && accepts && !follows) {
    follows := true.B
    ahead   := held - pixels.fire
    x       := Mux(sources(0).fire, xs(0), xs(1))
  }.elsewhen(follows && pixels.fire) {
    ahead   := ahead - 1.U
    follows := ahead =/= 0.U
  }
  assert(!follows || ahead =/= 0.U || pixels.bits.x === x, "the pixel that was accepted")

  private val waited = RegNext(follows && pixels.fire, false.B) && follows
  cover(waited && pixels.fire && ahead === 0.U && x === 15.U, "a pixel leaves after another")
  cover(held === 2.U && offers.reduce(_ && _), "both sources wait")
}

class PixelCollectorSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "PixelCollector"

  private val withoutHits = TestConfigs.tiny.copy(frame = TestConfigs.tiny.frame.copy(hits = false))

  it should "neither lose nor duplicate pixels" in {
    prove(new PixelCollectorProof(withoutHits))
  }

  for (count <- Seq(1, 3)) {
    it should s"merge $count streams at one pixel per cycle, the first one first" in {
      test(new PixelCollector(withoutHits, count)) { dut =>
        dut.io.pixels.ready.poke(true)
        dut.io.sources.zipWithIndex.foreach { case (source, number) => source.bits.x.poke(number) }
        // The last source offers first, then the one before it, until all do
        for (first <- (0 until count).reverse ++ Seq.fill(3)(0)) {
          for ((source, number) <- dut.io.sources.zipWithIndex) source.valid.poke(number >= first)
          for ((source, number) <- dut.io.sources.zipWithIndex) source.ready.expect(number <= first)
          dut.clock.step()
          dut.io.pixels.valid.expect(true)
          dut.io.pixels.bits.x.expect(first)
        }
      }
    }
  }

  it should "keep every bit under random stalls" in {
    val random = new Random(1)
    test(new PixelCollector(TestConfigs.tiny, 4)) { dut =>
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
            source.bits.isObject.poke(colour         % 2 == 1)
            source.bits.hit.get.triangle.poke(colour % 512)
          }
        }
        val takes = random.nextInt(3) > 0
        dut.io.pixels.ready.poke(takes)
        if (takes && dut.io.pixels.valid.peekBoolean()) {
          val bits          = dut.io.pixels.bits
          val pixel         = (bits.x.peekInt().toInt, bits.y.peekInt().toInt, bits.colour.g.peekInt().toInt)
          bits.isObject.expect(pixel._3         % 2 == 1)
          bits.hit.get.triangle.expect(pixel._3 % 512)
          assert(left.contains(pixel))
          left = if (left(pixel) == 1) left - pixel else left.updated(pixel, left(pixel) - 1)
        }
        for (row <- offers.indices if offers(row) && dut.io.sources(row).ready.peekBoolean())
          waiting(row) = waiting(row).tail
        dut.clock.step()
      }
    }
  }
}
