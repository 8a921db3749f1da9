package colonnade.formats

import chisel3._
import colonnade.numbers.Fixed

/** One number of a record, register or stream.
  *
  * @param name     flattened by `.` and `[i]`
  * @param offset   number of its lowest bit; bit 0 is the least significant
  * @param fraction fraction bits, 0 for integers
  * @param hasReset it is in no [[WithoutReset]]
  */
final case class Field(
    name:     String,
    offset:   Int,
    width:    Int,
    signed:   Boolean,
    fraction: Int,
    hasReset: Boolean = true
) {
  def end: Int = offset + width
}

/** Of registers: a reset leaves them as they are. The device reads them after the host has written a register with a
  * reset, such as their number.
  */
trait WithoutReset

/** The bit positions of the numbers in a Chisel type, derived from its definition, which is the only one.
  *
  * The first declared element of a bundle is the most significant. Element 0 of a vector is the least significant.
  */
object Layout {

  /** All numbers in the order of declaration. */
  def of(data: Data): Seq[Field] = place(data, "", 0)

  private def place(data: Data, name: String, offset: Int): Seq[Field] = data match {
    case fixed: Fixed =>
      Seq(Field(name, offset, fixed.format.width, fixed.format.signed, fixed.format.fraction))
    case vector: Vec[_] =>
      val elements = vector.map(element => element: Data)
      elements.zipWithIndex.flatMap { case (element, i) =>
        place(element, s"$name[$i]", offset + i * element.getWidth)
      }
    case record: Record =>
      val prefix            = if (name.isEmpty) "" else s"$name."
      val (names, elements) = record.elements.toSeq.unzip
      val offsets           = elements.scanLeft(offset)(_ + _.getWidth)
      names.zip(elements).zip(offsets).reverse.flatMap { case ((field, element), at) =>
        place(element, prefix + field, at)
      }.map(field => field.copy(hasReset = field.hasReset && !record.isInstanceOf[WithoutReset]))
    case signed: SInt => Seq(Field(name, offset, signed.getWidth, signed = true, fraction = 0))
    case other        => Seq(Field(name, offset, other.getWidth, signed = false, fraction = 0))
  }
}
