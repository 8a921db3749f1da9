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

/** Numbers of one kind, at positions that follow from their indexes: a row of [[FormatsPage]].
  *
  * `low[0].x` to `low[3].z` are `low[i<4].xyz` at `112+24i`, `104+24i` and `96+24i`.
  *
  * @param name    with `[]` for each index
  * @param letters last components of the name, of one letter each; empty if it has no such component
  * @param firsts  the position of each letter where all indexes are 0
  * @param counts  number of values of each index
  * @param strides difference of position of each index
  * @param kind    width, sign, fraction and limit
  */
private[formats] final case class FieldFamily(
    name:    String,
    letters: String,
    firsts:  Seq[Int],
    counts:  Seq[Int],
    strides: Seq[Int],
    kind:    String
) {
  require(counts.size <= FieldFamily.Indexes.size, s"$name has too many indexes")

  private val indexes = FieldFamily.Indexes.take(counts.size)

  def pattern: String = {
    val limits = indexes.zip(counts).map { case (index, count) => s"[$index<$count]" }
    val parts  = name.split("\\[\\]", -1)
    val filled = parts.zipAll(limits, "", "").map { case (part, limit) => part + limit }.mkString
    Seq(filled, letters).filter(_.nonEmpty).mkString(".")
  }

  def positions: String = {
    val terms = strides.zip(indexes).map { case (stride, index) => if (stride == 1) index else s"$stride$index" }
    firsts.map(first => (if (first == 0 && terms.nonEmpty) terms else s"$first" +: terms).mkString("+")).mkString(", ")
  }

  private def joins(next: FieldFamily): Boolean =
    letters.nonEmpty && next.letters.nonEmpty && next.copy(letters = letters, firsts = firsts) == this
}

private[formats] object FieldFamily {
  private val Indexes = Seq("i", "j", "k")
  private val Index   = """\[(\d+)\]""".r
  private val Letter  = """(?:(.*)\.)?([a-z])""".r

  /** The families of numbers, each a name, a position and a kind. */
  def of(numbers: Seq[(String, Int, String)]): Seq[FieldFamily] = {
    val families = for ((name, kind) <- numbers.map(patternAndKind).distinct) yield {
      val members = numbers.filter(patternAndKind(_) == ((name, kind)))
      val at      = members.map { case (member, position, _) => indexesOf(member) -> position }.toMap
      affine(name, at, kind)
    }
    families.foldLeft(Vector.empty[FieldFamily]) {
      case (done :+ last, next) if last.joins(next) =>
        done :+ last.copy(letters = last.letters + next.letters, firsts = last.firsts ++ next.firsts)
      case (done, next) => done :+ next
    }
  }

  private def affine(name: String, at: Map[Seq[Int], Int], kind: String): FieldFamily = {
    val counts  = at.keys.toSeq.transpose.map(_.max + 1)
    val zero    = counts.map(_ => 0)
    val strides = counts.indices.map(k => if (counts(k) > 1) at(zero.updated(k, 1)) - at(zero) else 0)
    val isWhole = at.size == counts.product && at.forall { case (indexes, position) =>
      position == at(zero) + indexes.zip(strides).map { case (index, stride) => index * stride }.sum
    }
    require(isWhole, s"$name is no regular family")
    name match {
      case Letter(prefix, letter) =>
        FieldFamily(Option(prefix).getOrElse(""), letter, Seq(at(zero)), counts, strides, kind)
      case _ => FieldFamily(name, "", Seq(at(zero)), counts, strides, kind)
    }
  }

  private def patternAndKind(number: (String, Int, String)): (String, String) =
    (Index.replaceAllIn(number._1, "[]"), number._3)

  private def indexesOf(name: String): Seq[Int] = Index.findAllMatchIn(name).map(_.group(1).toInt).toSeq
}
