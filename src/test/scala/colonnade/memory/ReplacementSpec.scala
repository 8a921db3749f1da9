package colonnade.memory

import chisel3._
import chiseltest._
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

/** One set: a way is used in each cycle, or the one to replace. */
private class OneSet(ways: Int, inMemory: Boolean) extends Module {
  val way      = IO(Input(UInt(5.W)))
  val replaces = IO(Input(Bool()))
  val victim   = IO(Output(UInt(5.W)))

  private val replacement = new Replacement(sets = 2, ways, inMemory)
  victim := replacement.victim(1.U)
  replacement.use(1.U, Mux(replaces, victim, way))
}

class ReplacementSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "Replacement"

  for {
    ways     <- Seq(1, 2, 3, 8, 10, 16)
    inMemory <- Seq(false, true)
  } it should s"replace each of $ways ways, but not the one used last, in a memory $inMemory" in {
    test(new OneSet(ways, inMemory)) { dut =>
      val random = new Random(ways)
      for (_ <- 0 until 200) {
        val way = random.nextInt(ways)
        dut.replaces.poke(false)
        dut.way.poke(way)
        dut.clock.step()
        if (ways > 1) dut.victim.peekInt().toInt should not be way
      }
      dut.replaces.poke(true)
      val victims = Seq.fill(32) {
        val victim = dut.victim.peekInt().toInt
        dut.clock.step()
        victim
      }
      val shares = (0 until ways).map(way => victims.count(_ == way))
      victims.max should be < ways
      shares.max should be <= 2 * shares.min
    }
  }
}
