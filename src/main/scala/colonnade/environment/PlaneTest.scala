package colonnade.environment

import chisel3._
import colonnade.numbers.Rounding

/** Tests a plane in an interval of the ray: the ray stays in front of it, crosses it, or is behind it. */
final class PlaneTest(m: MarchOperations, stepper: TileStepper, planes: PlaneCache) {
  import MarchLabel._
  import m.formats._
  import m.program._

  private val probe = m.lastCombined // of the step before

  val hitDistance: UInt = Reg(UInt(alongBits.W)) // the distance along the ray where it hits the environment

  /** Steps from `PlaneDepth` on; a hit continues at `Meets` or `Crosses`. */
  def describe(): Unit = {
    val isCell    = planes.purpose === planes.forCell
    val isNearest = planes.purpose === planes.forNearest
    step(PlaneDepth) {
      m.multiply(planes.depth.slope, stepper.enter.zext)
      set(stepper.wExit, m.combine(m.uvwOrigin(2), m.scaledProduct))
    }
    step {
      m.multiply(planes.depth.slope, stepper.exit.zext)
      set(stepper.depthEnter, m.combine(planes.depth.value, m.scaledProduct))
    }
    step {
      val depthExit = Rounding.narrow(m.combine(planes.depth.value, m.scaledProduct), depthBits)
      val isInFront = !stepper.isBehind && stepper.depthEnter >= 0.S && depthExit >= 0.S
      set(stepper.depthExit, depthExit)
      stepper.countStep(!isNearest)
      stepper.recordFront(isInFront && !isNearest)
      val isSame = stepper.hasFront && stepper.front.id === planes.id
      branch(
        Cells.when(isNearest && !isInFront, "several planes, not in front"),
        NearestPlane.when(isNearest, "several planes, in front"),
        CellPassed.when(isInFront && isCell, "cell, in front"),
        TilePassed.when(isInFront, "tile, in front"),
        Behind.when(stepper.isBehind, "already behind"),
        Crosses.when(stepper.depthEnter >= 0.S, "from front to back"),
        Meets.when(isSame, "behind the last front plane")
      )
    }
    near()
    behind()
    step(PlanePassed)(branch(CellPassed.when(isCell, "cell"), TilePassed.otherwise))
  }

  /** The ray enters behind the plane. If it is only slightly behind, it is on the plane. */
  private def near(): Unit = {
    step {
      m.multiply(stepper.enter.zext, m.uvwDir(2))
      m.load(stepper.depthEnter)
      m.setShift(planeFraction.S - planes.depth.exponent.zext)
    }
    step {
      m.combineForNext(m.uvwOrigin(2), m.scaledProduct)
      set(m.scaled, m.shifted)
    }
    step {
      val isNear = m.combine(m.scaled, (probe >> nearLog).asSInt) > 0.S
      set(stepper.isBehind, true.B, !isNear)
      branch(Meets.when(isNear, "slightly behind"))
    }
  }

  /** The ray is behind what the map shows. It may cross the extension of the last front plane, or emerge again. */
  private def behind(): Unit = {
    step(Behind) {
      m.multiply(stepper.front.slope, stepper.exit.zext)
      branch(Emerge.when(!stepper.hasFront, "no front plane"))
    }
    step(m.combineForNext(stepper.front.value, m.scaledProduct))
    step(branch(Crosses.when(probe < 0.S, "hidden surface")))
    step(Emerge)(stepper.recordFront(stepper.depthExit >= 0.S))
  }

  /** Steps from `Crosses` on, which find the distance where the depth becomes negative. */
  def describeCrossing(): Unit = {
    val depth = Mux(stepper.isBehind, stepper.front, planes.depth)
    step(Crosses) {
      m.load(depth.value)
      branch(Meets.when(depth.slope >= 0.S || depth.value <= 0.S, "no crossing"))
    }
    step(m.normalise())
    step {
      set(m.numerator, m.sumMantissa)
      set(m.exponents(0), m.exponent)
      m.loadSigned(depth.slope)
    }
    step(m.normalise())
    step(m.startDivision(m.numerator, m.sumMantissa))
    step {
      m.load(m.quotient.zext)
      m.awaitDivision()
    }
    step {
      m.takeQuotient()
      m.setShift(m.exponent.zext +& f.S - m.exponents(0).zext)
      m.latchExponent()
    }
    step(set(hitDistance, m.along))
    step {
      val isAfter = hitDistance > stepper.exit
      set(hitDistance, Mux(isAfter, stepper.exit, stepper.enter), isAfter || hitDistance < stepper.enter)
      goto(Hit)
    }
    step(Meets)(set(hitDistance, stepper.enter))
  }
}
