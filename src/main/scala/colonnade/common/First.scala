package colonnade.common

import chisel3._
import chisel3.util.{log2Ceil, Valid}

/** The claim that is granted now, and the one to be granted next, if known. */
final case class Choice(now: Valid[UInt], following: Valid[UInt])

object Choice {

  /** A choice that is not known before. */
  def apply(now: Valid[UInt]): Choice = Choice(now, 0.U.asTypeOf(now))
}

/** The lowest of some claims, as a tree whose depth is the logarithm of their number. */
object First {
  def apply(claims: Seq[Bool]): Valid[UInt] = {
    val (isAny, index) = lowest(claims.zipWithIndex.map { case (claim, index) => (claim, index.U) })
    val first          = Wire(Valid(UInt(log2Ceil(claims.size.max(2)).W)))
    first.valid := isAny
    first.bits  := index
    first
  }

  /** A registered choice, for so many claims that they need a cycle: it stays until `isServed`, and a claim is served
    * once. Claims must last until then.
    */
  def registered(claims: Seq[Bool], isServed: => Bool): Choice = {
    val chosen = RegInit(0.U.asTypeOf(Valid(UInt(log2Ceil(claims.size.max(2)).W))))
    val next   = First(claims.zipWithIndex.map { case (claim, index) =>
      claim && !(chosen.valid && chosen.bits === index.U)
    })
    val following = Mux(!chosen.valid || isServed, next, chosen)
    chosen := following
    Choice(chosen, following)
  }

  private def lowest(claims: Seq[(Bool, UInt)]): (Bool, UInt) =
    if (claims.size == 1) claims.head
    else {
      val ((low, lowIndex), (high, highIndex)) = {
        val (lower, upper) = claims.splitAt((claims.size + 1) / 2)
        (lowest(lower), lowest(upper))
      }
      (low || high, Mux(low, lowIndex, highIndex))
    }
}
