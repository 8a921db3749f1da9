package colonnade.shading

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.PathConfig
import colonnade.microcode.Label

/** The product of a step: at most one of these. n is the normal, d the ray's direction, c = −n·d the cosine up to a
  * factor. A product takes as many cycles as a factor has digits.
  */
final class BounceProducts extends Bundle {

  /** n·n, −n·d, d·d; a component at a time. */
  val squareNormal     = Bool()
  val dotNormalRay     = Bool()
  val squareRay        = Bool()
  val directionScale   = Bool()
  val twiceNormalScale = Bool()
  val normalScale      = Bool()

  /** |n|²·|d|², c², η², η²·sin². */
  val squaredLengths = Bool()
  val squaredCosine  = Bool()
  val etaSquared     = Bool()
  val etaTerm        = Bool()

  /** η·c, η·|n|². */
  val etaCosine       = Bool()
  val etaNormal       = Bool()
  val hemisphereCheck = Bool()
  val scaleOffset     = Bool()
  val normProduct     = Bool()

  /** Schlick's power of x = 1 − cosine: the sum times x, the sum squared, the sum times 1 − reflectance. */
  val timesOneMinusCosine      = Bool()
  val squarePower              = Bool()
  val timesOneMinusReflectance = Bool()

  def any: Bool = asUInt.orR

  /** A factor has more than two digits. */
  def isLong: Bool = etaTerm || scaleOffset

  def all: Seq[Bool] = elements.values.toSeq.map(_.asInstanceOf[Bool])
}

/** The other actions of a step; they happen in its first cycle. */
final class BounceActions extends Bundle {
  val normaliseNormal = Bool() // double the normal while its largest component is too short

  // The adder: at most one of these. The two scalings double the sum, depending on the exponent
  val accumulate        = Bool()
  val loadProduct       = Bool()
  val scaleCosine       = Vec(3, Bool())
  val scaleDiscriminant = Vec(3, Bool())
  val squaredSine       = Bool()
  val discriminant      = Bool()
  val subtractRoot      = Bool()
  val shiftInOrigin     = Bool()
  val oneMinusCosine    = Bool()
  val addReflectance    = Bool()

  /** With `accumulate`: the product is the first one of a sum; subtract it. */
  val startSum = Bool()
  val subtract = Bool()

  // Registers that take the sum or the product
  val latchNormalSquared  = Bool()
  val latchCosine         = Bool()
  val latchRaySquared     = Bool()
  val latchSquaredLengths = Bool()
  val latchEtaSquared     = Bool()
  val latchDirectionScale = Bool()
  val latchNormalScale    = Bool()
  val shiftInReflection   = Bool()
  val shiftInRefraction   = Bool()

  // Root and quotient; the program waits for them
  val startRoot       = Bool()
  val startCosineRoot = Bool()
  val divide          = Bool()
  val latchQuotient   = Bool()
  val shiftQuotient   = Bool()

  /** Signals that choose the adder's operands. */
  def additions: Seq[Bool] = Seq(accumulate, loadProduct) ++ scaleCosine ++ scaleDiscriminant ++
    Seq(squaredSine, discriminant, subtractRoot, shiftInOrigin, oneMinusCosine, addReflectance)
}

/** Control signals of the bounce datapath for one cycle. A register that no signal names keeps its value. */
final class BounceControl(formats: BounceFormats) extends Bundle {
  val load      = Bool()
  val startOver = Bool() // take the geometric normal

  val products = new BounceProducts

  /** The digit to multiply. A step begins with the highest digit and ends with digit 0. */
  val isFirst = Bool()
  val digit   = UInt(log2Ceil(formats.longDigits).W)
  val actions = new BounceActions
}

/** What the program needs to know about the datapath. */
final class BounceStatus extends Bundle {

  /** Of the sum. */
  val isPositive = Bool()
  val isNegative = Bool()

  val rootIsReady       = Bool() // the root or quotient that was started is ready
  val dotIsNormalised   = Bool() // the dot product's top bit is set
  val quotientIsShifted = Bool() // the quotient is in its place
}

/** State of the current bounce, written by [[BounceProgram]] and its unit. */
final class BounceState {
  val isGlass:      Bool = Reg(Bool())
  val isSmooth:     Bool = Reg(Bool())
  val backSide:     Bool = Reg(Bool())
  val isRefraction: Bool = Reg(Bool()) // the ray is refracted, not reflected
  val hasFresnel:   Bool = Reg(Bool()) // the result has a Fresnel term
}

final class BounceDatapathIO(config: PathConfig) extends Bundle {
  val control      = Input(new BounceControl(new BounceFormats(config.numbers)))
  val request      = Input(new BounceRequest(config))
  val offset       = Input(UInt((config.numbers.gridBits - 2).W))
  val isRefraction = Input(Bool())                    // the ray enters the material that it hits
  val status       = Output(new BounceStatus)
  val result       = Output(new BounceResult(config)) // constant from the program's last step on
}

/** Labels of [[BounceProgram]]. */
sealed trait BounceLabel extends Label

object BounceLabel {
  case object Idle            extends BounceLabel // waits for a hit
  case object GeometricNormal extends BounceLabel // normalises the geometric normal, which replaces the smooth one
  case object DotProducts     extends BounceLabel // computes the lengths of normal and ray, and their angle
  case object Reflect         extends BounceLabel // computes the reflected direction
  case object Discriminant    extends BounceLabel // computes Snell's discriminant
  case object Root            extends BounceLabel // takes the discriminant's root
  case object Refract         extends BounceLabel // computes the refracted direction
  case object HemisphereCheck extends BounceLabel // checks on which side of the surface the ray goes on
  case object Offset          extends BounceLabel // moves the origin to the other side of the surface
  case object Cosine          extends BounceLabel // computes the cosine for Schlick's approximation
  case object Fresnel         extends BounceLabel // computes Schlick's approximation of the Fresnel term
  case object Done            extends BounceLabel // offers the result
}
