package colonnade.environment

import chisel3._

/** Passes a plane: is the ray in front of it all the way, does it meet it, or go behind? */
final class MarchPass(m: MarchDatapath, walk: MarchWalk, planes: MarchPlanes) {
  import m.formats._
  import m.program._

  private val scaled = Reg(SInt(scaledBits.W))
  private val probe  = Reg(SInt(depthBits.W))

  /** Where the ray meets the room. */
  val met: UInt = Reg(UInt(alongBits.W))

  /** Steps from the label "depth" on; a hit goes on at "meets" or "crosses". */
  def describe(): Unit = {
    val isCell   = planes.purpose === planes.forCell
    val isSurvey = planes.purpose === planes.forSurvey
    step("depth")(m.multiply(planes.depth.slope, walk.from.zext))
    step {
      m.multiply(planes.depth.slope, walk.to.zext)
      set(walk.enters, m.combine(planes.depth.value, m.share))
    }
    step {
      m.multiply(walk.to.zext, m.way(2))
      set(walk.leaves, m.combine(planes.depth.value, m.share))
    }
    step {
      set(walk.there, m.combine(m.place(2), m.share))
      set(walk.steps, walk.steps + 1.U, !isSurvey)
      walk.keep(walk.isFront && !isSurvey)
      val isSame = walk.hasPlane && walk.kept.id === planes.id
      branch(
        (isSurvey && !walk.isFront) -> "cells",
        isSurvey                    -> "survey",
        (walk.isFront && isCell)    -> "cell passed",
        walk.isFront                -> "tile passed",
        walk.isBehind               -> "behind",
        (walk.enters >= 0.S)        -> "crosses",
        isSame                      -> "meets"
      )
    }
    near()
    behind()
    step("passed")(branch(isCell -> "cell passed", true.B -> "tile passed"))
  }

  /** The ray comes above a plane and is behind it: hardly, then it is on it. */
  private def near(): Unit = {
    step {
      m.multiply(walk.from.zext, m.way(2))
      m.load(walk.enters)
      set(m.drop, planeFraction.S - planes.depth.exponent.zext)
    }
    step {
      set(probe, m.combine(m.place(2), m.share))
      set(scaled, m.shifted)
    }
    step {
      val isNear = m.combine(scaled, (probe >> nearLog).asSInt) > 0.S
      set(walk.isBehind, true.B, !isNear)
      branch(isNear -> "meets")
    }
  }

  /** The ray is behind what the camera sees: it may meet the extension of the last plane, or come out again. */
  private def behind(): Unit = {
    step("behind") {
      m.multiply(walk.kept.slope, walk.to.zext)
      branch(!walk.hasPlane -> "may come out")
    }
    step(set(probe, m.combine(walk.kept.value, m.share)))
    step(branch((probe < 0.S) -> "crosses"))
    step("may come out") {
      walk.keep(walk.leaves >= 0.S)
    }
  }

  /** Steps that find where a depth becomes negative. */
  def crossing(): Unit = {
    val depth = Mux(walk.isBehind, walk.kept, planes.depth)
    step("crosses") {
      m.load(depth.value)
      branch((depth.slope >= 0.S || depth.value <= 0.S) -> "meets")
    }
    step(m.measure())
    step {
      set(m.numerator, m.shifted.asUInt(f - 1, 0))
      set(m.lengths(0), m.length)
      m.load(depth.slope)
    }
    step(m.flip(true.B))
    step(m.measure())
    step(set(m.mantissa, m.shifted.asUInt(f - 1, 0)))
    m.divide(m.numerator, m.mantissa)
    step(m.load(m.quotient.zext))
    step {
      set(m.drop, m.length.zext +& f.S - m.lengths(0).zext)
      set(m.length, m.measured)
    }
    step(set(met, m.saturatedNatural(alongBits)))
    step(set(met, walk.to, met > walk.to))
    step {
      set(met, walk.from, met < walk.from)
      goto("met")
    }
    step("meets")(set(met, walk.from))
  }
}
