package colonnade.numbers

import chisel3._
import chisel3.util.Cat

/** Scales vectors to the length of a stored normal, `one`: a table has the reciprocals of 128 lengths. A vector is then at
  * most `one` long and less than 1 % shorter, before its components are rounded.
  */
object UnitLength {
  val factorBits: Int = 10

  private val mantissaBits = 7

  /** A quarter of one / length, in the least power of two that is above the length.
    *
    * @param squared the squared length: its bits are 2 · `octave`, or one less
    * @param one the length of a stored normal
    */
  def factor(squared: UInt, octave: Int, one: Int): UInt = {
    val isOdd    = !squared(2 * octave - 1)
    val mantissa = Mux(
      isOdd,
      squared(2 * octave - 3, 2 * octave - 1 - mantissaBits),
      squared(2 * octave - 2, 2 * octave - mantissaBits)
    )
    VecInit(table(one).map(_.U(factorBits.W)))(Cat(isOdd, mantissa))
  }

  /** For the upper end of the squared lengths with a mantissa, whose top bit is set. */
  private def table(one: Int): Seq[BigInt] = for {
    shift <- Seq(3, 4)
    next  <- (1 << (mantissaBits - 1)) + 1 to 1 << mantissaBits
  } yield root((BigInt(one).pow(2) << shift) / next)

  private def root(x: BigInt): BigInt = BigInt(math.sqrt(x.toDouble).floor.toLong)
}
