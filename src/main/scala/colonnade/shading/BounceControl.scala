package colonnade.shading

import chisel3._
import chisel3.util.log2Ceil

/** What is multiplied in a step: at most one of these. A product takes as many cycles as a factor has digits. */
final class BounceFactors extends Bundle {
  val squareNormal = Bool()
  val project      = Bool()
  val squareRay    = Bool()
  val parallel     = Bool()
  val acrossTwice  = Bool()
  val across       = Bool()
  val whole        = Bool()
  val upright      = Bool()
  val squareEta    = Bool()
  val bend         = Bool()
  val etaAlong     = Bool()
  val etaSquare    = Bool()
  val side         = Bool()
  val offset       = Bool()
  val lengths      = Bool()
  val power        = Bool()
  val powerSquare  = Bool()
  val powerRest    = Bool()

  def any: Bool = asUInt.orR

  /** A factor has more than two digits. */
  def isLong: Bool = bend || offset
}

/** What else happens in a step, in the first of its cycles. */
final class BounceWork extends Bundle {

  /** Double the normal while its largest component is too short. */
  val normalise = Bool()

  // The adder: at most one of these
  val accumulate     = Bool()
  val takeProduct    = Bool()
  val lengthen       = Vec(3, Bool())
  val lengthenAgain  = Vec(3, Bool())
  val lessUpright    = Bool()
  val lessBent       = Bool()
  val takeRoot       = Bool()
  val pushOrigin     = Bool()
  val away           = Bool()
  val addReflectance = Bool()

  /** Accumulate from the first product on; subtract what is accumulated. */
  val first    = Bool()
  val subtract = Bool()

  // Registers that take the sum or the product
  val keepSquare     = Bool()
  val keepAlong      = Bool()
  val keepRay        = Bool()
  val keepWhole      = Bool()
  val keepSquareEta  = Bool()
  val keepParallel   = Bool()
  val keepAcross     = Bool()
  val pushReflection = Bool()
  val pushRefraction = Bool()

  // Root and quotient; the program waits for them
  val root         = Bool()
  val cosineRoot   = Bool()
  val divide       = Bool()
  val takeQuotient = Bool()
  val lower        = Bool()
}

/** What the bounce datapath does in one cycle. Registers that nothing here names keep their values. */
final class BounceControl(formats: BounceFormats) extends Bundle {
  val load = Bool()

  /** Take the geometric normal. */
  val startOver = Bool()

  val factors = new BounceFactors

  /** Which digit is multiplied: the step begins with the first one, and ends with number 0. */
  val isFirst = Bool()
  val digit   = UInt(log2Ceil(formats.longDigits).W)
  val work    = new BounceWork
}
