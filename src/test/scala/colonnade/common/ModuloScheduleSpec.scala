package colonnade.common

import chisel3._
import chiseltest._
import org.scalatest.flatspec.AnyFlatSpec

/** Adds the three components of a vector that comes in cycles 0 to 3, and offers the first one again later. */
private class SumOfThree(readAt: Int, unitAt: Seq[Int]) extends Module {
  val vector  = IO(Input(Vec(3, UInt(8.W))))
  val sum     = IO(Output(UInt(10.W)))
  val delayed = IO(Output(UInt(8.W)))
  val phase   = IO(Output(UInt(2.W)))

  private val count = RegInit(0.U(2.W))
  count := count + 1.U
  phase := count
  private val schedule = new ModuloSchedule(count)
  import schedule._

  private val held      = arriving(vector, 0, 3)
  private val component = latch(unitAt)(select(unitAt)(held.at(unitAt)(_)))
  private val total     = accumulate(unitAt.map(_ + 1), component.at(unitAt.map(_ + 1)).pad(10))(_ + _)
  sum     := carry(total, readAt).at(readAt)
  delayed := delay(component, unitAt.map(_ + 1), 6).at(unitAt.map(_ + 7))
}

class ModuloScheduleSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "ModuloSchedule"

  it should "take the same steps for an operation every four cycles" in
    test(new SumOfThree(readAt = 9, unitAt = Seq(0, 1, 2))) { dut =>
      val vectors = Seq.tabulate(12, 3)((operation, axis) => (37 * operation + 11 * axis) % 256)
      for (cycle <- 0 until 48) {
        val (operation, step) = (cycle / 4, cycle % 4)
        dut.phase.expect(step)
        dut.vector.zip(vectors(operation)).foreach { case (port, value) => port.poke(value) }
        if (step == 1 && operation >= 2) dut.sum.expect(vectors(operation - 2).sum)
        // Cycles 7 to 9 of an operation
        for (axis <- 0 until 3; begun = cycle - 7 - axis; if begun >= 0 && begun % 4 == 0)
          dut.delayed.expect(vectors(begun / 4)(axis))
        dut.clock.step()
      }
    }

  /** Two values of a register, written in these cycles. */
  private class TwoValues(cycles: Seq[Int]) extends Module {
    val input = IO(Input(UInt(8.W)))
    new ModuloSchedule(RegInit(0.U(2.W))).latch(cycles)(input)
  }

  /** The reason why a schedule is refused. */
  private def refusal(module: => Module): String =
    Iterator.iterate[Throwable](intercept[Exception](test(module)(_ => ())))(_.getCause)
      .takeWhile(_ != null).map(_.toString).mkString(" ")

  it should "refuse a value that is used when its register holds another one" in
    assert(refusal(new SumOfThree(3, Seq(0, 1, 2))).contains("a value of cycles 4 to 5 is used in cycle 3"))

  it should "refuse two steps of a unit in one cycle" in
    assert(refusal(new TwoValues(Seq(1, 5))).contains("collide modulo 4"))
}
