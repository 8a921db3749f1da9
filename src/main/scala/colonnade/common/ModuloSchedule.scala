package colonnade.common

import chisel3._
import chisel3.util.{log2Ceil, Mux1H}

/** Values of one register of a [[ModuloSchedule]], and for each of them the cycles in which the register holds it.
  *
  * Cycles count from the start of an operation. A use in another cycle is an error at elaboration.
  */
final class Timed[T <: Data](bits: T, windows: Seq[(Int, Int)]) {

  /** The register in these cycles, one for each value; or the only value, in all of these cycles. */
  def at(cycles: Seq[Int]): T = {
    val pairs = if (windows.size == 1) cycles.map(_ -> windows.head) else cycles.zip(windows)
    require(windows.size == 1 || windows.size == cycles.size, s"${cycles.size} uses of ${windows.size} values")
    for ((cycle, (first, last)) <- pairs)
      require(first <= cycle && cycle <= last, s"a value of cycles $first to $last is used in cycle $cycle")
    bits
  }

  def at(cycle: Int): T = at(Seq(cycle))

  /** These values alone. */
  def items(indices: Int*): Timed[T] = new Timed(bits, indices.map(windows))

  /** The first cycle of the first value, and the last cycle of the last one. */
  def first: Int = windows.head._1
  def last: Int  = windows.last._2
}

/** A modulo schedule: an operation starts every `interval` cycles, and each takes the same steps in the same cycles. So
  * one unit serves up to `interval` steps of an operation, while other units work on the operations before and after
  * it.
  *
  * Nothing ever stalls. The schedule is checked at elaboration: two steps of one unit in the same cycle modulo the
  * interval, and a register that is read in a cycle in which it holds another value, are errors.
  *
  * @param phase counts the cycles modulo the interval; an operation starts in phase 0
  */
final class ModuloSchedule(phase: UInt, interval: Int = ModuloSchedule.interval) {

  /** This cycle of an operation, one operation or the other. */
  def isAt(cycle: Int): Bool = phase === (cycle % interval).U

  /** A value from elsewhere, in these cycles. */
  def arriving[T <: Data](bits: T, first: Int, last: Int): Timed[T] = new Timed(bits, Seq(first -> last))

  /** Successive values from elsewhere. */
  def arriving[T <: Data](bits: T, cycles: Seq[Int]): Timed[T] = new Timed(bits, cycles.map(cycle => cycle -> cycle))

  /** The operand of each cycle. */
  def select[T <: Data](cycles: Seq[Int])(operand: Int => T): T = {
    check(cycles)
    val operands = cycles.indices.map(operand)
    val selected = Wire(chiselTypeOf(operands.head))
    selected := Mux1H(cycles.map(isAt).zip(operands))
    selected
  }

  /** A register that takes its input at the end of these cycles. */
  def latch[T <: Data](cycles: Seq[Int])(next: T): Timed[T] = latched(cycles, Reg(chiselTypeOf(next)))(next)

  def latch[T <: Data](cycle: Int)(next: T): Timed[T] = latch(Seq(cycle))(next)

  /** As `latch`, and a reset clears the register: for a flag that tells whether there is an operation. */
  def latchFlag(cycle: Int)(next: Bool): Timed[Bool] = latched(Seq(cycle), RegInit(false.B))(next)

  private def latched[T <: Data](cycles: Seq[Int], register: T)(next: T): Timed[T] = {
    check(cycles)
    when(cycles.map(isAt).reduce(_ || _))(register := next)
    new Timed(register, cycles.map(cycle => (cycle + 1) -> (cycle + untilNext(cycle, cycles))))
  }

  /** Combines the inputs of these cycles. */
  def accumulate[T <: Data](cycles: Seq[Int], next: T)(combine: (T, T) => T): Timed[T] = {
    check(cycles)
    val register = Reg(chiselTypeOf(next))
    when(isAt(cycles.head)) { register := next }
      .elsewhen(cycles.tail.map(isAt).reduce(_ || _)) { register := combine(register, next) }
    new Timed(register, Seq((cycles.last + 1) -> (cycles.head + interval)))
  }

  /** A single value, in a register of each interval up to a cycle. */
  def carry[T <: Data](value: Timed[T], to: Int): Timed[T] =
    if (to <= value.last) value else carry(latch(value.last)(value.at(value.last)), to)

  /** As [[carry]], with the registers of [[latchFlag]]. */
  def carryFlag(value: Timed[Bool], to: Int): Timed[Bool] =
    if (to <= value.last) value else carryFlag(latchFlag(value.last)(value.at(value.last)), to)

  /** Successive values of a register, so many cycles after its own. */
  def delay[T <: Data](values: Timed[T], cycles: Seq[Int], by: Int): Timed[T] = {
    val delayed = (0 until by).foldLeft(values.at(cycles)) { (from, _) =>
      val register = Reg(chiselTypeOf(from))
      register := from
      register
    }
    arriving(delayed, cycles.map(_ + by))
  }

  /** The exact product of two factors that are there for an interval from a cycle on. A digit of the right one is
    * multiplied in each cycle, the lowest first; the product comes in the second cycle after.
    */
  def multiply(left: Timed[SInt], right: Timed[SInt], first: Int): Timed[SInt] = {
    val cycles    = first until first + interval
    val digitBits = (right.at(cycles).getWidth + interval - 2) / interval
    val factor    = right.at(cycles).pad(interval * digitBits + 1)
    val top       = (interval - 1) * digitBits
    val digits    = (0 until top by digitBits).map(low => factor(low + digitBits - 1, low).zext) :+ (factor >> top)
    val product   = latch(cycles)(left.at(cycles) * select(cycles)(digits(_)))
    accumulate(cycles.map(_ + 1), (product.at(cycles.map(_ + 1)) << top).asSInt) {
      (sum, next) => (sum >> digitBits) + next
    }
  }

  private def check(cycles: Seq[Int]): Unit =
    require(cycles.map(_ % interval).distinct.size == cycles.size, s"cycles $cycles collide modulo $interval")

  /** Cycles until the register is written again. */
  private def untilNext(cycle: Int, cycles: Seq[Int]): Int =
    cycles.map(other => Math.floorMod(other - cycle - 1, interval) + 1).min
}

object ModuloSchedule {
  val interval: Int = 3 // cycles from an operation to the next

  /** A counter of the cycles of an interval. */
  def phase(): UInt = UInt(log2Ceil(interval).W)

  /** Three cycles, one for each axis or channel. */
  def xyz(first: Int): Seq[Int] = first until first + 3
}
