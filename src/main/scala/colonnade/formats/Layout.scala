package colonnade.formats

import chisel3._
import colonnade.numbers.Fixed

/** One number of a record, register or stream.
  *
  * @param name     flattened by `.` and `[i]`
  * @param offset   bit, 0 is the least significant
  * @param fraction fraction bits, 0 for integers
  */
final case class Field(name: String, offset: Int, width: Int, signed: Boolean, fraction: Int) {
  def end: Int = offset + width
}

/** Where the numbers of a Chisel type lie in its bits, most significant first. Read off the definition itself, so that
  * there is no other one.
  */
object Layout {

  /** A flattened number before it has a place. */
  final case class Leaf(name: String, width: Int, signed: Boolean, fraction: Int)

  def of(data: Data): Seq[Field] = {
    val numbers = leaves(data)
    val offsets = numbers.scanRight(0)((number, below) => below + number.width).tail
    numbers.zip(offsets).map { case (n, offset) => Field(n.name, offset, n.width, n.signed, n.fraction) }
  }

  /** Numbers in the order of `asUInt`: of a bundle the first declared, of a vector the last comes first. */
  def leaves(data: Data, name: String = ""): Seq[Leaf] = data match {
    case fixed: Fixed   => Seq(Leaf(name, fixed.format.width, fixed.format.signed, fixed.format.fraction))
    case vector: Vec[_] =>
      vector.zipWithIndex.reverse.flatMap { case (element: Data, i) => leaves(element, s"$name[$i]") }
    case record: Record =>
      val prefix = if (name.isEmpty) "" else s"$name."
      record.elements.toSeq.reverse.flatMap { case (field, element) => leaves(element, prefix + field) }
    case signed: SInt => Seq(Leaf(name, signed.getWidth, signed = true, fraction = 0))
    case other        => Seq(Leaf(name, other.getWidth, signed = false, fraction = 0))
  }
}
