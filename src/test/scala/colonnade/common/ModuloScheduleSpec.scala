package colonnade.common

import chisel3._
import chiseltest._
import org.scalatest.flatspec.AnyFlatSpec

/** Adds the three components of a vector that comes in cycles 0 to 2, multiplies the first two, and offers all again
  * later.
  */
private class SumOfThree(readAt: Int, unitAt: Seq[Int]) extends Module {
  val vector  = IO(Input(Vec(3, UInt(8.W))))
  val sum     = IO(Output(UInt(10.W)))
  val delayed = IO(Output(UInt(8.W)))
  val product = IO(Output(SInt(17.W)))
  val phase   = IO(Output(ModuloSchedule.phase()))

  private val count = RegInit(0.U.asTypeOf(phase))
  count := Mux(count === 2.U, 0.U, count + 1.U)
  phase := count
  private val schedule = new ModuloSchedule(count)
  import schedule._

  private val held      = arriving(vector, 0, 2)
  private val component = latch(unitAt)(select(unitAt)(held.at(unitAt)(_)))
  private val total     = accumulate(unitAt.map(_ + 1), component.at(unitAt.map(_ + 1)).pad(10))(_ + _)
  sum     := carry(total, readAt).at(readAt)
  delayed := delay(component, unitAt.map(_ + 1), 5).at(unitAt.map(_ + 6))

  // As signed numbers
  private val factors = vector.take(2).map(factor => arriving((factor -% 100.U).asSInt, 0, 2))
  product := multiply(factors.head, factors.last, 0).at(4)
}

class ModuloScheduleSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "ModuloSchedule"

  it should "take the same steps for an operation every three cycles" in
    test(new SumOfThree(readAt = 8, unitAt = Seq(0, 1, 2))) { dut =>
      val vectors            = Seq.tabulate(16, 3)((operation, axis) => (37 * operation * (axis + 1) + 11 * axis) % 256)
      def signed(value: Int) = (value - 100).toByte.toInt
      for (cycle <- 0 until 48) {
        val (operation, step) = (cycle / 3, cycle % 3)
        dut.phase.expect(step)
        dut.vector.zip(vectors(operation)).foreach { case (port, value) => port.poke(value) }
        if (step == 2 && operation >= 2) dut.sum.expect(vectors(operation - 2).sum)
        if (step == 1 && operation >= 1) dut.product.expect(vectors(operation - 1).take(2).map(signed).product)
        // Cycles 6 to 8 of an operation
        if (operation >= 2) dut.delayed.expect(vectors(operation - 2)(step))
        dut.clock.step()
      }
    }

  /** Two values of a register, written in these cycles. */
  private class TwoValues(cycles: Seq[Int]) extends Module {
    val input = IO(Input(UInt(8.W)))
    new ModuloSchedule(RegInit(0.U.asTypeOf(ModuloSchedule.phase()))).latch(cycles)(input)
  }

  /** The reason why a schedule is refused. */
  private def refusal(module: => Module): String =
    Iterator.iterate[Throwable](intercept[Exception](test(module)(_ => ())))(_.getCause)
      .takeWhile(_ != null).map(_.toString).mkString(" ")

  it should "refuse a value that is used when its register holds another one" in
    assert(refusal(new SumOfThree(3, Seq(0, 1, 2))).contains("a value of cycles 4 to 4 is used in cycle 3"))

  it should "refuse two steps of a unit in one cycle" in
    assert(refusal(new TwoValues(Seq(1, 4))).contains("collide modulo 3"))
}
