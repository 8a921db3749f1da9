package colonnade.shading

import chisel3._
import colonnade.config.NumberFormats
import colonnade.microcode.{Microprogram, Overlap, Repeat, StepEncoding}

/** The bounce unit's microprogram. A step takes one cycle, or one per digit if it multiplies.
  *
  * The product of a step is accumulated in the next one; the sum is ready two steps after its last product. To start
  * over is to take the geometric normal instead of the smooth one.
  *
  * @param takes      a hit is taken
  * @param isTaken    the result is taken
  * @param moreDigits the step's product is incomplete: repeat the step
  */
final class BounceProgram(
    control:    BounceControl,
    state:      BounceState,
    status:     BounceStatus,
    takes:      Bool,
    isTaken:    Bool,
    moreDigits: Bool
) {
  import BounceLabel._
  import control.{actions, products}

  private val sumLatency = 2

  val program = new Microprogram[BounceLabel](StepEncoding.Binary(stall = moreDigits))
  import program.{branch, raise, set}

  private def xyz(first: Int): Range = first until first + 3

  private def pairs(first: Int): Seq[(Int, Int)] = Seq(0, 2, 4).map(i => (first + i, first + i + 1))

  // The schedule, in cycles of the overlapped part: lengths and angle
  private val squareNormal       = xyz(0)
  private val latchNormalSquared = squareNormal.last + sumLatency
  private val dotNormalRay       = xyz(squareNormal.last + 1)
  private val latchCosine        = dotNormalRay.last + sumLatency
  private val squareRay          = xyz(latchCosine + 1)
  private val latchRaySquared    = squareRay.last + sumLatency
  require(latchNormalSquared < latchCosine, "the angle is scaled by the normal's length")

  // Two products for each axis of a direction
  private val reflect           = pairs(squareRay.last + 1)
  private val shiftInReflection = reflect.map(_._2 + sumLatency)

  // Snell's discriminant, |n|²·|d|² − η²·sin²
  private val squaredLengths    = reflect.last._2 + 1
  private val squaredCosine     = squaredLengths + 1
  private val etaSquared        = squaredCosine + 1
  private val scaleCosine       = xyz(squaredCosine + sumLatency)
  private val squaredSine       = scaleCosine.last + 1
  private val etaTerm           = squaredSine + 1
  private val discriminant      = etaTerm + 1
  private val checkTotal        = etaTerm + sumLatency
  private val scaleDiscriminant = xyz(checkTotal)

  // Its root; meanwhile the factors of direction and normal
  private val startRoot           = scaleDiscriminant.last + 1
  private val etaCosine           = startRoot + 1
  private val etaNormal           = etaCosine + 1
  private val latchDirectionScale = etaNormal + 1
  private val subtractRoot        = latchDirectionScale + 1
  private val latchNormalScale    = subtractRoot + 1

  private val refract           = pairs(latchNormalScale + 1)
  private val shiftInRefraction = refract.map(_._2 + sumLatency)
  private val hemisphereCheck   = xyz(shiftInRefraction.last + 1)
  private val checkHemisphere   = hemisphereCheck.last + sumLatency

  // Sum and origin share the adder
  private val scaleOffset   = pairs(checkHemisphere + 1).map(_._1)
  private val shiftInOrigin = scaleOffset.map(_ + sumLatency)

  private val squareAgain = xyz(shiftInOrigin.last + 1)
  private val latchAgain  = squareAgain.last + sumLatency
  private val dotAgain    = xyz(squareAgain.last + 1)
  private val normProduct = dotAgain.last + 1
  private val cosineRoot  = normProduct + 1
  private val divide      = cosineRoot + 1
  private val quotient    = divide + 1
  private val shift       = quotient + 1
  private val oneMinus    = shift + 1
  private val powers      = Seq(0, 1, 2, 3).map(oneMinus + 1 + 2 * _)
  require(normProduct > latchAgain, "the normal's length comes before its product")

  program.exclusive("multiplier", products.all)
  program.exclusive("adder", actions.additions)

  program.step(Idle) {
    raise(control.load, takes)
    branch(Repeat.until(takes, "request"), DotProducts.otherwise)
  }
  program.label(GeometricNormal)
  for (_ <- 1 until NumberFormats.normalBits) program.step(raise(actions.normaliseNormal))
  program.overlap { at =>
    at.label(0, DotProducts)
    at.label(reflect.head._1, Reflect)
    at.label(squaredCosine + 1, Discriminant)
    at.label(startRoot, Root)
    at.label(refract.head._1, Refract)
    at.label(hemisphereCheck.head, HemisphereCheck)
    at.label(scaleOffset.head, Offset)
    at.label(squareAgain.head, Cosine)
    at.label(oneMinus, Fresnel)
    dotProducts(at)
    reflection(at)
    snell(at)
    root(at)
    refraction(at)
    hemisphere(at)
    offset(at)
    cosine(at)
    fresnel(at)
  }
  program.step(Done)(branch(Repeat.until(isTaken, "the result is taken"), Idle.otherwise))

  private def dotProducts(at: Overlap[BounceLabel]): Unit = {
    dot(at, squareNormal, products.squareNormal)
    at(latchNormalSquared)(raise(actions.latchNormalSquared))
    dot(at, dotNormalRay, products.dotNormalRay, subtract = true)
    at(latchCosine) {
      raise(actions.latchCosine)
      branch(startOver(!status.isPositive, "the smooth normal turns away"))
    }
    dot(at, squareRay, products.squareRay)
    at(latchRaySquared)(raise(actions.latchRaySquared))
  }

  /** |n|²·d + 2c·n. */
  private def reflection(at: Overlap[BounceLabel]): Unit = {
    blend(at, reflect, products.twiceNormalScale)
    shiftInReflection.foreach(at(_)(raise(actions.shiftInReflection)))
    at(shiftInReflection.last)(branch(HemisphereCheck.when(!state.isGlass, "mirror")))
  }

  private def snell(at: Overlap[BounceLabel]): Unit = {
    dot(at, Seq(squaredLengths), products.squaredLengths)
    at(squaredLengths + sumLatency)(raise(actions.latchSquaredLengths))
    dot(at, Seq(squaredCosine), products.squaredCosine)
    for ((cycle, bit) <- scaleCosine.zipWithIndex) at(cycle)(raise(actions.scaleCosine(bit)))
    at(etaSquared)(program.raiseEarly(products.etaSquared))
    at(etaSquared + 1)(raise(actions.latchEtaSquared))
    at(squaredSine)(raise(actions.squaredSine))
    at(etaTerm)(program.raiseEarly(products.etaTerm))
    at(discriminant)(raise(actions.discriminant))
    at(checkTotal) {
      set(state.isRefraction, true.B, !status.isNegative)
      branch(HemisphereCheck.when(status.isNegative, "total internal reflection"))
    }
    for ((cycle, bit) <- scaleDiscriminant.zipWithIndex) at(cycle)(raise(actions.scaleDiscriminant(bit)))
  }

  private def root(at: Overlap[BounceLabel]): Unit = {
    at(startRoot)(raise(actions.startRoot))
    at(etaCosine)(program.raiseEarly(products.etaCosine))
    at(etaCosine + 1)(raise(actions.loadProduct))
    at(etaNormal)(program.raiseEarly(products.etaNormal))
    at(latchDirectionScale)(raise(actions.latchDirectionScale))
    at(subtractRoot) {
      raise(actions.subtractRoot)
      program.await(status.rootIsReady, "root")
    }
    at(latchNormalScale)(raise(actions.latchNormalScale))
  }

  /** η|n|²·d + (ηc − root)·n. */
  private def refraction(at: Overlap[BounceLabel]): Unit = {
    blend(at, refract, products.normalScale)
    shiftInRefraction.foreach(at(_)(raise(actions.shiftInRefraction)))
  }

  private def hemisphere(at: Overlap[BounceLabel]): Unit = {
    dot(at, hemisphereCheck, products.hemisphereCheck)
    val isWrong = Mux(state.isRefraction, !status.isNegative, !status.isPositive)
    at(checkHemisphere) {
      branch(startOver(isWrong, "wrong side of the surface"), Done.when(!state.isRefraction, "reflection"))
    }
  }

  private def offset(at: Overlap[BounceLabel]): Unit = {
    scaleOffset.foreach(cycle => dot(at, Seq(cycle), products.scaleOffset, subtract = true))
    shiftInOrigin.foreach(at(_)(raise(actions.shiftInOrigin)))
    at(shiftInOrigin.last) {
      set(state.hasFresnel, true.B, !state.backSide)
      branch(Done.when(state.backSide, "back side"))
    }
  }

  private def cosine(at: Overlap[BounceLabel]): Unit = {
    dot(at, squareAgain, products.squareNormal)
    at(latchAgain)(raise(actions.latchNormalSquared))
    dot(at, dotAgain, products.dotNormalRay, subtract = true)
    at(normProduct)(program.raiseEarly(products.normProduct))
    at(cosineRoot) {
      raise(actions.startCosineRoot)
      branch(Fresnel.when(!status.isPositive, "the cosine is 0"))
    }
    at(divide) {
      raise(actions.divide)
      program.await(status.dotIsNormalised && status.rootIsReady, "root")
    }
    at(quotient) {
      raise(actions.latchQuotient)
      program.await(status.rootIsReady, "quotient")
    }
    at(shift) {
      raise(actions.shiftQuotient)
      program.await(status.quotientIsShifted, "the quotient is shifted")
    }
  }

  /** With x = 1 − cosine: x², x⁴, x⁵, and that times 1 − reflectance. */
  private def fresnel(at: Overlap[BounceLabel]): Unit = {
    at(oneMinus)(raise(actions.oneMinusCosine))
    import products.{squarePower, timesOneMinusCosine, timesOneMinusReflectance}
    val factors = Seq(timesOneMinusCosine, squarePower, timesOneMinusCosine, timesOneMinusReflectance)
    for ((cycle, product) <- powers.zip(factors)) at(cycle)(program.raiseEarly(product))
    powers.init.foreach(cycle => at(cycle + 1)(raise(actions.loadProduct)))
    at(powers.last + 1)(raise(actions.addReflectance))
  }

  /** Multiplies in these cycles, and sums up one cycle later. */
  private def dot(at: Overlap[BounceLabel], cycles: Seq[Int], product: Bool, subtract: Boolean = false): Unit = {
    cycles.foreach { cycle =>
      at(cycle)(program.raiseEarly(product))
      at(cycle + 1)(raise(actions.accumulate))
      if (subtract) at(cycle + 1)(raise(actions.subtract))
    }
    at(cycles.head + 1)(raise(actions.startSum))
  }

  /** A multiple of the direction plus a multiple of the normal, for each axis. */
  private def blend(at: Overlap[BounceLabel], cycles: Seq[(Int, Int)], ofNormal: Bool): Unit =
    for ((first, second) <- cycles) {
      dot(at, Seq(first), products.directionScale)
      at(second)(program.raiseEarly(ofNormal))
      at(second + 1)(raise(actions.accumulate))
    }

  private def startOver(condition: Bool, reason: String) = {
    val isWrong = state.isSmooth && condition
    raise(control.startOver, isWrong)
    set(state.isSmooth, false.B, isWrong)
    set(state.isRefraction, false.B, isWrong)
    GeometricNormal.when(isWrong, reason)
  }
}
