package colonnade.shading

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.NumberFormats

/** What the bounce datapath does in one cycle. Registers that nothing here names keep their values. */
final class BounceControl extends Bundle {
  val load = Bool()

  /** Take the geometric normal; then double it while its largest component is too short. */
  val startOver = Bool()
  val normalise = Bool()

  // Factors of a product: at most one of these
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

/** The bounces' microprogram: which step does what, one step a cycle.
  *
  * {{{
  * measure | n·n | −n·d | d·d                              | n may turn away: start over
  * reflect | |n|²·d + 2(n·d)·n                             | a mirror goes on at `side`
  * glass   | |n|²|d|², (n·d)², η² | rest | root | η|n|², η(n·d) − root    | total reflection goes on at `side`
  * refract | η|n|²·d + (…)·n
  * side    | direction · facing                            | the wrong side: start over; a reflection ends
  * offset  | origin − 2 · offset · facing                  | on the back side a refraction ends
  * share   | n·n | −n·d | |n|²|d|² | root | quotient | 1 − cosine | ⁵ |
  * }}}
  * To start over is to take the geometric normal, which the first steps normalise. Products of step s reach the sum in
  * s + 1; the sum is there to use in s + 2.
  */
final class BounceProgram {
  private val toSum = 2

  private def three(first: Int): Range = first until first + 3

  private val normalise = 0 until NumberFormats.normalBits - 1

  // Lengths and angle. The normal and the direction have turned all the way when the angle is known
  val measure: Int = normalise.last + 1
  private val squareNormal = three(measure)
  private val keepSquare   = squareNormal.last + toSum
  private val project      = three(squareNormal.last + 1)
  private val keepAlong    = project.last + toSum
  private val squareRay    = three(keepAlong + 1)
  private val keepRay      = squareRay.last + toSum
  require(keepSquare < keepAlong, "the angle is scaled by the normal's length")

  /** The sum is the angle's cosine, up to a factor. */
  val checkFacing: Int = keepAlong

  private def directions(first: Int): Seq[(Int, Int)] =
    Seq(0, 1, 2).map(axis => (first + 2 * axis, first + 2 * axis + 1))
  private val reflect        = directions(squareRay.last + 1)
  private val pushReflection = reflect.map(_._2 + toSum)

  /** The reflection is known. */
  val checkGlass: Int = pushReflection.last

  // What is left of the direction along the normal, squared
  private val whole         = reflect.last._2 + 1
  private val keepWhole     = whole + toSum
  private val upright       = whole + 1
  private val squareEta     = upright + 1
  private val keepSquareEta = squareEta + 1
  private val lengthen      = three(upright + toSum)
  private val lessUpright   = lengthen.last + 1
  private val bend          = lessUpright + 1
  private val lessBent      = bend + 1

  /** The sum is negative: total reflection. */
  val checkRest: Int = bend + toSum

  // Its root; meanwhile the factors' other parts
  private val lengthenAgain = three(checkRest)
  private val root          = lengthenAgain.last + 1
  private val etaAlong      = root + 1
  private val etaSquare     = etaAlong + 1
  private val keepParallel  = etaSquare + 1
  private val takeRoot      = keepParallel + 1
  private val keepAcross    = takeRoot + 1

  private val refract        = directions(keepAcross + 1)
  private val pushRefraction = refract.map(_._2 + toSum)

  val side: Int = pushRefraction.last + 1
  private val sideProducts = three(side)

  /** The sum tells on which side of the surface the ray goes on. */
  val checkSide: Int = sideProducts.last + toSum

  // The other side of the surface; sum and origin take turns at the adder
  private val offset     = Seq(0, 1, 2).map(checkSide + 1 + 2 * _)
  private val pushOrigin = offset.map(_ + toSum)

  /** The refraction is known. */
  val checkShare: Int = pushOrigin.last

  // The cosine
  private val squareAgain     = three(checkShare + 1)
  private val keepSquareAgain = squareAgain.last + toSum
  private val projectAgain    = three(squareAgain.last + 1)
  private val lengths         = projectAgain.last + 1
  require(lengths > keepSquareAgain, "the normal's length comes before its product")

  /** The product is that of both lengths, the sum that of the vectors: if it is not positive, the cosine is 0. */
  val cosineRoot: Int = lengths + 1
  private val divide       = cosineRoot + 1
  private val takeQuotient = divide + 1
  private val lower        = takeQuotient + 1
  val away: Int = lower + 1

  // Schlick's share
  private val powers      = Seq(0, 1, 2, 3).map(away + 1 + 2 * _)
  private val takeProduct = (etaAlong +: powers.take(3)).map(_ + 1)

  /** All is done: nothing happens in this step. */
  val last:     Int = powers.last + toSum
  val stepBits: Int = log2Ceil(last + 1)

  /** Decodes a step. */
  def control(step: UInt): BounceControl = {
    def in(steps: Seq[Int]): Bool = steps.map(step === _.U).reduce(_ || _)
    def at(steps: Int*): Bool     = in(steps)

    val products = reflect ++ refract
    val sums     =
      Seq(squareNormal, project, squareRay, Seq(whole), Seq(upright), sideProducts, squareAgain, projectAgain) ++
        products.map { case (parallel, across) => Seq(parallel, across) } ++ offset.map(Seq(_))
    val control = Wire(new BounceControl)
    control.load      := false.B
    control.startOver := false.B
    control.normalise := in(normalise)

    control.squareNormal := in(squareNormal ++ squareAgain)
    control.project      := in(project ++ projectAgain)
    control.squareRay    := in(squareRay)
    control.parallel     := in(products.map(_._1))
    control.acrossTwice  := in(reflect.map(_._2))
    control.across       := in(refract.map(_._2))
    control.whole        := at(whole)
    control.upright      := at(upright)
    control.squareEta    := at(squareEta)
    control.bend         := at(bend)
    control.etaAlong     := at(etaAlong)
    control.etaSquare    := at(etaSquare)
    control.side         := in(sideProducts)
    control.offset       := in(offset)
    control.lengths      := at(lengths)
    control.power        := at(powers(0), powers(2))
    control.powerSquare  := at(powers(1))
    control.powerRest    := at(powers(3))

    control.accumulate     := in(sums.flatten.map(_ + 1))
    control.first          := in(sums.map(_.head + 1))
    control.subtract       := in((project ++ projectAgain ++ offset).map(_ + 1))
    control.takeProduct    := in(takeProduct)
    control.lengthen       := VecInit(lengthen.map(at(_)))
    control.lengthenAgain  := VecInit(lengthenAgain.map(at(_)))
    control.lessUpright    := at(lessUpright)
    control.lessBent       := at(lessBent)
    control.takeRoot       := at(takeRoot)
    control.pushOrigin     := in(pushOrigin)
    control.away           := at(away)
    control.addReflectance := at(powers.last + 1)

    control.keepSquare     := at(keepSquare, keepSquareAgain)
    control.keepAlong      := at(keepAlong)
    control.keepRay        := at(keepRay)
    control.keepWhole      := at(keepWhole)
    control.keepSquareEta  := at(keepSquareEta)
    control.keepParallel   := at(keepParallel)
    control.keepAcross     := at(keepAcross)
    control.pushReflection := in(pushReflection)
    control.pushRefraction := in(pushRefraction)

    control.root         := at(root)
    control.cosineRoot   := at(cosineRoot)
    control.divide       := at(divide)
    control.takeQuotient := at(takeQuotient)
    control.lower        := at(lower)
    control
  }
}
