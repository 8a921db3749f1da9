package colonnade.bus

import chisel3._
import chisel3.util.{Cat, RegEnable}
import colonnade.config.NumberFormats

import scala.collection.concurrent.TrieMap

/** Encodes a linear channel as 8 bits of sRGB (IEC 61966-2-1), rounded to the nearest code.
  *
  * A search by halves in the table of the least linear values of all codes, two bits of the code in each of four cycles in
  * which `enable` lets values move.
  *
  * @param linearBits width of a linear value; all ones is 1.0
  */
final class SrgbEncoder(linearBits: Int = NumberFormats.colourBits) extends Module {
  val linear = IO(Input(UInt(linearBits.W)))
  val enable = IO(Input(Bool()))
  val code   = IO(Output(UInt(SrgbEncoder.codeBits.W)))

  /** The code's next bit, below the bits that are known. */
  private def next(known: Option[UInt], value: UInt): UInt = {
    val bit    = SrgbEncoder.codeBits - 1 - known.fold(0)(_.getWidth)
    val tables =
      VecInit(SrgbEncoder.leastLinear(linearBits).grouped(2 << bit).map(_(1 << bit).U(value.getWidth.W)).toSeq)
    val least = known.fold(tables.head)(tables(_))
    known.fold((value >= least).asUInt)(Cat(_, value >= least))
  }
  private def part(known: Option[UInt], value: UInt): UInt =
    (0 until SrgbEncoder.codeBits / SrgbEncoder.latency).foldLeft(known)((bits, _) => Some(next(bits, value))).get

  private val (_, found) = (0 until SrgbEncoder.latency).foldLeft((linear, Option.empty[UInt])) {
    case ((value, known), _) =>
      (RegEnable(value, enable), Some(RegEnable(part(known, value), enable)))
  }
  code := found.get
}

object SrgbEncoder {
  val codeBits: Int = 8
  val latency:  Int = 4

  /** The code of a linear value. */
  def apply(linear: Int, linearBits: Int = NumberFormats.colourBits): Int = {
    val value   = linear.toDouble / ((1 << linearBits) - 1)
    val encoded = if (value <= 0.0031308) 12.92 * value else 1.055 * math.pow(value, 1 / 2.4) - 0.055
    math.rint(255 * encoded).toInt
  }

  /** The linear value of a code, rounded to the nearest. */
  def decoded(code: Int, linearBits: Int): Int = {
    val value  = code / 255.0
    val linear = if (value <= 0.04045) value / 12.92 else math.pow((value + 0.055) / 1.055, 2.4)
    math.rint(linear * ((1 << linearBits) - 1)).toInt
  }

  private val tables = TrieMap.empty[Int, IndexedSeq[Int]]

  /** The least linear value of each code, or of a higher one. */
  private def leastLinear(linearBits: Int): IndexedSeq[Int] = tables.getOrElseUpdate(
    linearBits, {
      val codes = (0 until 1 << linearBits).map(apply(_, linearBits))
      (0 until 1 << codeBits).map(code => codes.indexWhere(_ >= code))
    }
  )
}
