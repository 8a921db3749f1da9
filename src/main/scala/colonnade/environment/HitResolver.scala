package colonnade.environment

import chisel3._
import colonnade.formats.EnvironmentView
import colonnade.microcode.Repeat

/** The end of a march: a hit on a surface of the map, a hit on the nearest bounding plane, or a miss. */
final class HitResolver(
    m:           MarchOperations,
    stepper:     TileStepper,
    planes:      PlaneCache,
    hitPixel:    HitPixel,
    texel:       TexelFetch,
    hitDistance: UInt,
    view:        EnvironmentView,
    request:     MarchRequest
) {
  import MarchLabel._
  import m.formats._
  import m.program._

  val kind:          HitKind.Type = Reg(HitKind())
  val boundingPlane: UInt         = Reg(UInt(layout.boundingPlaneIndexBits.W))
  val exponent: SInt = Reg(SInt(shiftBits.W)) // the distance is quotient · 2^exponent times the scaled direction

  val index: UInt = Reg(UInt(view.boundingPlanes.getWidth.W)) // of a bounding plane, or of a plane of the frustum

  /** The largest rate so far: of approach to distance of the bounding planes, or of distance to approach of the frustum's
    * planes, which is the way to the last one.
    */
  val rateMantissa: UInt = Reg(UInt((f + 1).W))
  val rateExponent: SInt = Reg(SInt(shiftBits.W))

  /** In a step: nothing is hit yet. */
  def clear(): Unit = {
    set(kind, HitKind.miss)
    set(exponent, 0.S)
    set(boundingPlane, 0.U)
    set(m.quotient, 0.U)
  }

  /** Connects the result, which is valid in `Finish`. */
  def result(to: MarchResult): Unit = {
    val isMap  = kind === HitKind.map
    val isMiss = kind === HitKind.miss
    to.kind             := kind
    to.x                := Mux(isMap, hitPixel.x, 0.U)
    to.y                := Mux(isMap, hitPixel.y, 0.U)
    to.boundingPlane    := boundingPlane
    to.isHidden         := isMap && stepper.isBehind
    to.distance         := Mux(isMiss, 0.U, m.quotient)
    to.distanceExponent := Mux(isMiss, 0.S, exponent)
    to.steps            := stepper.steps
  }

  /** Steps after `Meets`: the hit's pixel, and its distance s / w in the length of the scaled direction. */
  def describeHit(): Unit = {
    step(Hit) {
      hitPixel.forHit()
      goto(Pixel)
    }
    step(HitDistance) {
      m.multiply(hitDistance.zext, m.uvwDir(2))
      set(kind, HitKind.map)
      texel.requestPixel()
    }
    step(set(stepper.wExit, m.combine(m.uvwOrigin(2), m.scaledProduct)))
    step(m.load(Mux(stepper.wExit < 1.S, 1.S, stepper.wExit)))
    step(m.normalise())
    step {
      set(m.mantissa, m.sumMantissa)
      set(m.exponents(0), m.exponent)
      m.load(hitDistance.zext)
    }
    step(m.normalise())
    step {
      set(m.numerator, m.sumMantissa)
      set(exponent, m.exponent.zext +& (f.S +& view.exponent) - m.exponents(0).zext - m.projectedDirExponent.zext)
    }
    step {
      m.startDivision(m.numerator, m.mantissa)
      set(exponent, exponent - m.uvwDirExponent.zext)
      goto(Point)
    }
  }

  /** Steps from `BoundingPlanes` on: the nearest bounding plane that the ray approaches. */
  def describeBoundingPlanes(): Unit = {
    step(BoundingPlanes) {
      m.multiply(m.projectedDir(2), m.constant(sizes(0)))
      branch(Finish.when(request.isFromCamera, "from a camera"))
    }
    step {
      m.multiply(m.projectedDir(2), m.constant(sizes(1)))
      set(m.uvwDir(0), m.combine(m.projectedDir(0), fromCentre, subtract = true))
      set(planes.purpose, planes.forBoundingPlane)
      set(index, 0.U)
    }
    step(set(m.uvwDir(1), m.combine(m.projectedDir(1), fromCentre, subtract = true)))
    step(BoundingPlane) {
      set(planes.id, index)
      val isOver = index === view.boundingPlanes || index === layout.config.boundingPlanes.U
      branch(BoundingPlanesDone.when(isOver, "no more planes"), Plane.otherwise)
    }
    step(BoundingDepth) {
      branch(NextBoundingPlane.when(planes.depth.value <= 0.S || m.sum <= 0.S, "behind, or not approaching"))
    }
    step(m.normalise())
    step {
      set(m.numerator, m.sumMantissa)
      set(m.exponents(0), m.exponent)
      m.load(planes.depth.value)
    }
    step(m.normalise())
    step(Rate)(set(m.mantissa, m.sumMantissa))
    m.divide(m.numerator, m.mantissa)
    step {
      val quotient = Mux(m.quotient(f), m.quotient, (m.quotient << 1)(f, 0))
      val rate     = m.exponents(0).zext - m.exponent.zext +& Mux(m.quotient(f), (f + 1).S, f.S)
      val isFirst  = kind === HitKind.miss && !request.isFromCamera
      val isNearer = isFirst || rate > rateExponent || (rate === rateExponent && quotient > rateMantissa)
      set(kind, HitKind.boundingPlane, !request.isFromCamera)
      set(rateMantissa, quotient, isNearer)
      set(rateExponent, rate, isNearer)
      set(boundingPlane, index, isNearer && !request.isFromCamera)
    }
    step(NextBoundingPlane) {
      set(index, index + 1.U)
      branch(ClipPlane.when(request.isFromCamera, "from a camera"), BoundingPlane.otherwise)
    }
    step(BoundingPlanesDone) {
      val isMiss = kind === HitKind.miss
      texel.requestBoundingPlane(boundingPlane, !isMiss)
      branch(Finish.when(isMiss, "miss"), Repeat.until(texel.isRequested, "planes.req is ready"))
    }
    step {
      m.startDivision(m.depthMantissa, (rateMantissa >> 1)(f - 1, 0))
      set(exponent, m.depthExponent.zext +& m.uvwOriginExponent.zext - rateExponent - m.projectedDirExponent.zext)
      goto(Point)
    }
  }

  /** Half the map's size times the direction's depth, in map units. */
  private def fromCentre: SInt = (m.product >> (mapLog + 1)).asSInt
}
