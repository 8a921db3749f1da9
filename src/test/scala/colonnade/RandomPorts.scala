package colonnade

import chisel3._
import chiseltest._

import scala.util.Random

/** Ports as a whole: all numbers of a bundle, in the order of its fields. */
object RandomPorts {

  /** Pokes each number of an input with any value of its width; gives the values. */
  def randomise(data: Data, random: Random): Seq[BigInt] = numbers(data).map { number =>
    val value = BigInt(number.getWidth, random)
    number match {
      case signed: SInt =>
        val least = BigInt(-1) << (signed.getWidth - 1)
        signed.poke(least + value)
        least + value
      case other =>
        other.asInstanceOf[UInt].poke(value)
        value
    }
  }

  def peek(data: Data): Seq[BigInt] = numbers(data).map {
    case number: SInt => number.peekInt()
    case number       => number.asInstanceOf[UInt].peekInt()
  }

  private def numbers(data: Data): Seq[Bits] = data match {
    case vec: Vec[_]    => vec.flatMap(element => numbers(element.asInstanceOf[Data]))
    case record: Record => record.elements.values.toSeq.reverse.flatMap(numbers)
    case number: Bits   => Seq(number)
    case other          => throw new IllegalArgumentException(s"a port of $other")
  }
}
