package colonnade.memory

import chisel3._
import chiseltest._
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

/** One set: a way is used in each cycle, or the one to replace. */
private class OneSet(ways: Int, inMemory: Boolean) extends Module {
  val io = IO(new Bundle {
    val way      = Input(UInt(5.W))
    val replaces = Input(Bool())
    val victim   = Output(UInt(5.W))
  })

  private val replacement = new Replacement(sets = 2, ways, inMemory)
  io.victim := replacement.victim(1.U)
  replacement.use(1.U, Mux(io.replaces, io.victim, io.way))
}

/** Sets of several shapes, which go on independently. */
private class Sets(shapes: Seq[(Int, Boolean)]) extends Module {
  val sets = shapes.map { case (ways, inMemory) => Module(new OneSet(ways, inMemory)) }
  val io   = IO(Vec(shapes.size, chiselTypeOf(sets.head.io)))
  sets.zip(io).foreach { case (set, port) => port :<>= set.io }
}

class ReplacementSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "Replacement"

  private val shapes = for (ways <- Seq(1, 2, 3, 8, 10, 16); inMemory <- Seq(false, true)) yield (ways, inMemory)

  it should "replace each of some ways, but not the one used last" in {
    test(new Sets(shapes)) { dut =>
      val random = new Random(1)
      dut.io.foreach(_.replaces.poke(false))
      for (_ <- 0 until 200) {
        val used = shapes.map { case (ways, _) => random.nextInt(ways) }
        used.zip(dut.io).foreach { case (way, io) => io.way.poke(way) }
        dut.clock.step()
        for ((((ways, _), io), way) <- shapes.zip(dut.io).zip(used) if ways > 1)
          io.victim.peekInt().toInt should not be way
      }
      dut.io.foreach(_.replaces.poke(true))
      val victims = Seq.fill(32) {
        val each = dut.io.map(_.victim.peekInt().toInt)
        dut.clock.step()
        each
      }.transpose
      for (((ways, inMemory), victims) <- shapes.zip(victims)) withClue(s"$ways ways, in a memory $inMemory: ") {
        val shares = (0 until ways).map(way => victims.count(_ == way))
        victims.max should be < ways
        shares.max should be <= 2 * shares.min
      }
    }
  }
}
