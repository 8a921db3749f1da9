package colonnade.shading

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.NumberFormats

/** The bounces' microprogram: which step does what. A step takes one cycle, or one a digit if it multiplies.
  *
  * {{{
  * measure | n·n | −n·d | d·d                              | n may turn away: start over
  * reflect | |n|²·d + 2(n·d)·n                             | a mirror goes on at `side`
  * glass   | |n|²|d|², (n·d)², η² | root, η(n·d), η|n|²   | total reflection goes on at `side`
  * refract | η|n|²·d + (η(n·d) − root)·n                   |
  * side    | direction · facing                            | the wrong side: start over; a reflection ends
  * offset  | origin − 2 · offset · facing                  | on the back side a refraction ends
  * share   | n·n | −n·d | |n|²|d|² | cosine | (1 − cosine)⁵ |
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
  private val products       = reflect ++ refract

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

  private def in(step: UInt)(steps: Seq[Int]): Bool = steps.map(step === _.U).reduce(_ || _)

  /** Decodes a step. */
  def factors(step: UInt): BounceFactors = {
    def at(steps: Int*): Bool = in(step)(steps)

    val factors = Wire(new BounceFactors)
    factors.squareNormal := in(step)(squareNormal ++ squareAgain)
    factors.project      := in(step)(project ++ projectAgain)
    factors.squareRay    := in(step)(squareRay)
    factors.parallel     := in(step)(products.map(_._1))
    factors.acrossTwice  := in(step)(reflect.map(_._2))
    factors.across       := in(step)(refract.map(_._2))
    factors.whole        := at(whole)
    factors.upright      := at(upright)
    factors.squareEta    := at(squareEta)
    factors.bend         := at(bend)
    factors.etaAlong     := at(etaAlong)
    factors.etaSquare    := at(etaSquare)
    factors.side         := in(step)(sideProducts)
    factors.offset       := in(step)(offset)
    factors.lengths      := at(lengths)
    factors.power        := at(powers(0), powers(2))
    factors.powerSquare  := at(powers(1))
    factors.powerRest    := at(powers(3))
    factors
  }

  /** Decodes a step. */
  def work(step: UInt): BounceWork = {
    def at(steps: Int*): Bool = in(step)(steps)

    val sums =
      Seq(squareNormal, project, squareRay, Seq(whole), Seq(upright), sideProducts, squareAgain, projectAgain) ++
        products.map { case (parallel, across) => Seq(parallel, across) } ++ offset.map(Seq(_))
    val work = Wire(new BounceWork)
    work.normalise := in(step)(normalise)

    work.accumulate     := in(step)(sums.flatten.map(_ + 1))
    work.first          := in(step)(sums.map(_.head + 1))
    work.subtract       := in(step)((project ++ projectAgain ++ offset).map(_ + 1))
    work.takeProduct    := in(step)(takeProduct)
    work.lengthen       := VecInit(lengthen.map(at(_)))
    work.lengthenAgain  := VecInit(lengthenAgain.map(at(_)))
    work.lessUpright    := at(lessUpright)
    work.lessBent       := at(lessBent)
    work.takeRoot       := at(takeRoot)
    work.pushOrigin     := in(step)(pushOrigin)
    work.away           := at(away)
    work.addReflectance := at(powers.last + 1)

    work.keepSquare     := at(keepSquare, keepSquareAgain)
    work.keepAlong      := at(keepAlong)
    work.keepRay        := at(keepRay)
    work.keepWhole      := at(keepWhole)
    work.keepSquareEta  := at(keepSquareEta)
    work.keepParallel   := at(keepParallel)
    work.keepAcross     := at(keepAcross)
    work.pushReflection := in(step)(pushReflection)
    work.pushRefraction := in(step)(pushRefraction)

    work.root         := at(root)
    work.cosineRoot   := at(cosineRoot)
    work.divide       := at(divide)
    work.takeQuotient := at(takeQuotient)
    work.lower        := at(lower)
    work
  }
}
