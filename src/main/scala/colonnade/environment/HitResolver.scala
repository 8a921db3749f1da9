package colonnade.environment

import chisel3._
import chisel3.util.Enum
import colonnade.formats.EnvironmentView
import colonnade.microcode.Overlap
import colonnade.numbers.Rounding

/** The end of a march: a hit on a surface of the map, a hit on the nearest bounding plane, or a miss. */
final class HitResolver(
    m:           MarchOperations,
    stepper:     TileStepper,
    planes:      PlaneCache,
    hitPixel:    HitPixel,
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

  /** The largest rate so far: of approach to distance of the bounding planes, or of distance to approach of the
    * frustum's planes, which is the way to the last one.
    */
  val rateMantissa: UInt = Reg(UInt((f + 1).W))
  val rateExponent: SInt = Reg(SInt(shiftBits.W))

  /** There is a bounding plane after the indexed one. */
  val hasNext: Bool = !isOver(index +& 1.U)

  private def isOver(index: UInt): Bool = index === view.boundingPlanes || index === layout.config.boundingPlanes.U

  /** In a step: nothing is hit yet. */
  def clear(): Unit = {
    set(kind, HitKind.miss)
    set(boundingPlane, 0.U)
  }

  /** Connects the result, which is valid in `Finish`. */
  def result(to: MarchHit): Unit = {
    to.kind         := kind
    to.pixel.x      := hitPixel.x
    to.pixel.y      := hitPixel.y
    to.isHidden     := stepper.isBehind
    to.numerator    := m.numerator
    to.denominator  := m.mantissa
    to.exponent     := exponent
    to.way.mantissa := rateMantissa
    to.way.exponent := rateExponent
  }

  /** Steps after `Meets`: the hit's pixel, and its distance s / w in the length of the scaled direction. */
  def describeHit(): Unit = {
    step(Hit) {
      hitPixel.forHit()
      m.multiply(hitDistance.zext, m.uvwDir(2))
      goto(Pixel)
    }
    step(HitDistance) {
      set(kind, HitKind.map)
      set(exponent, exponent - m.uvwDirExponent.zext)
      goto(Finish)
    }
  }

  /** Numerator and denominator of the distance, beside the steps from `Pixel` on. */
  def measureDistance(at: Overlap[MarchLabel]): Unit = {
    at(0)(set(stepper.wExit, m.combine(m.uvwOrigin(2), m.scaledProduct)))
    at(1)(m.load(Mux(stepper.wExit < 1.S, 1.S, stepper.wExit)))
    at(2)(m.normalise())
    at(3) {
      set(m.mantissa, m.sumMantissa)
      set(m.exponents(0), m.exponent)
      m.load(hitDistance.zext)
    }
    at(4)(m.normalise())
    at(5) {
      set(m.numerator, m.sumMantissa)
      set(exponent, m.exponent.zext +& (f.S +& view.exponent) - m.exponents(0).zext - m.projectedDirExponent.zext)
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
      branch(BoundingPlanesDone.when(isOver(index), "no planes"), Plane.otherwise)
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
    step {
      m.normalise()
      goto(Rate)
    }
    step(Rate)(m.startDivision(m.numerator, m.sumMantissa))
    step {
      val quotient = Mux(m.quotient(f), m.quotient, (m.quotient << 1)(f, 0))
      val rate     = m.exponents(0).zext - m.exponent.zext +& Mux(m.quotient(f), (f + 1).S, f.S)
      val isFirst  = kind === HitKind.miss && !request.isFromCamera
      val isNearer = isFirst || rate > rateExponent || (rate === rateExponent && quotient > rateMantissa)
      set(kind, HitKind.boundingPlane, m.hasQuotient && !request.isFromCamera)
      set(rateMantissa, quotient, m.hasQuotient && isNearer)
      set(rateExponent, rate, m.hasQuotient && isNearer)
      set(boundingPlane, index, m.hasQuotient && isNearer && !request.isFromCamera)
      m.takeQuotient()
      m.awaitDivision(ClipPlane.when(request.isFromCamera, "from a camera"))
    }
    step(NextBoundingPlane) {
      set(index, index + 1.U)
      set(planes.id, index + 1.U)
      branch(Plane.when(hasNext, "another plane"))
    }
    step(BoundingPlanesDone) {
      set(m.numerator, m.depthMantissa)
      set(m.mantissa, (rateMantissa >> 1)(f - 1, 0))
      set(exponent, m.depthExponent.zext +& m.uvwOriginExponent.zext - rateExponent - m.projectedDirExponent.zext)
      goto(Finish)
    }
  }

  /** Half the map's size times the direction's depth, in map units. */
  private def fromCentre: SInt = (m.product >> (mapLog + 1)).asSInt
}

/** Projects a point of the ray to a pixel, and clamps the pixel to a part of the map. */
final class HitPixel(m: MarchOperations, stepper: TileStepper, hitDistance: UInt) {
  import MarchLabel._
  import m.formats._
  import m.program._

  private val Seq(cell, visible, hidden) = Enum(3)
  private val purpose                    = Reg(UInt(2.W))
  private val coordinate                 = Rounding.narrow(m.lastCombined, depthBits) // of the step before

  val x: UInt = Reg(UInt(layout.xBits.W))
  val y: UInt = Reg(UInt(layout.yBits.W))

  private val at   = Mux(purpose === cell, stepper.enter, Mux(purpose === hidden, stepper.frontDistance, hitDistance))
  private val size = (1.U << Mux(purpose === cell, layout.tileLog.U, stepper.frontLog)) - 1.U

  /** In the step before a jump to `Pixel`: project the point where the ray enters the tile, and continue at
    * `FirstCell`.
    */
  def forCell(): Unit = set(purpose, cell)

  /** In the step before `Pixel`: project the hit, and continue at `HitDistance`. */
  def forHit(): Unit = set(purpose, Mux(stepper.isBehind, hidden, visible))

  /** Steps from `Pixel` on, beside the steps that measure the hit's distance; for a cell they have no effect. */
  def describe(distance: Overlap[MarchLabel] => Unit): Unit = {
    label(Pixel)
    overlap { at =>
      distance(at)
      pixel(at)
    }
  }

  private def pixel(cycle: Overlap[MarchLabel]): Unit = {
    cycle(0)(m.multiply(at.zext, m.uvwDir(0)))
    cycle(1)(m.combineForNext(m.uvwOrigin(0), m.scaledProduct))
    cycle(2) {
      m.combineForNext(coordinate, m.constant(centre(0)))
      m.multiply(at.zext, m.uvwDir(1))
    }
    cycle(3) {
      set(x, clamp(stepper.tileCorner.x, stepper.frontCorner.x, sizes(0)))
      m.combineForNext(m.uvwOrigin(1), m.scaledProduct)
    }
    cycle(4)(m.combineForNext(coordinate, m.constant(centre(1))))
    cycle(5) {
      set(y, clamp(stepper.tileCorner.y, stepper.frontCorner.y, sizes(1)))
      branch(FirstCell.when(purpose === cell, "first cell"), HitDistance.otherwise)
    }
  }

  /** Clamps to the tile, to the part of the map that shows the last front plane, or to the map. */
  private def clamp(ofTile: UInt, ofPlane: UInt, mapSize: Int): UInt = {
    val pixel = (coordinate >> pixelFraction).asSInt
    val low   = Mux(purpose === visible, 0.U, Mux(purpose === cell, ofTile, ofPlane))
    val end   = low +& size
    val high  = Mux(purpose === visible || end >= mapSize.U, (mapSize - 1).U, end)
    Mux(pixel < low.zext, low, Mux(pixel > high.zext, high, pixel.asUInt))
  }
}
