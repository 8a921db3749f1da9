package colonnade.common

import chisel3._
import chiseltest._
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class DelayLineSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "DelayLine"

  for (delay <- Seq(2, 3, 8))
    it should s"give each value $delay moves later, and hold it while the pipeline stalls" in {
      val random = new Random(delay)
      test(new DelayLine(UInt(16.W), delay)) { dut =>
        var stages =
          Vector.fill(delay)(Option.empty[Int]) // what was written with the last moves; the last one is out
        for (_ <- 0 until 2000) {
          stages.last.foreach(dut.io.out.expect(_))
          val value = Option.when(random.nextInt(3) > 0)(random.nextInt(1 << 16))
          val moves = random.nextInt(3) > 0
          dut.io.moves.poke(moves)
          dut.io.writes.poke(value.isDefined)
          dut.io.in.poke(value.getOrElse(0))
          dut.io.reads.poke(stages(delay - 2).isDefined)
          dut.clock.step()
          if (moves) stages = value +: stages.init
        }
      }
    }
}
