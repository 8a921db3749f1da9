package colonnade.environment

import chisel3._
import chisel3.util.Fill
import colonnade.config.NumberFormats
import colonnade.formats.EnvironmentView
import colonnade.microcode.Overlap
import colonnade.numbers.{Fixed, Rounding}

/** The hit point, from its distance and the ray's origin; and its normal, rotated to the object's space. */
final class SurfacePoint(
    m:        MarchOperations,
    stepper:  TileStepper,
    texel:    TexelFetch,
    resolver: HitResolver,
    view:     EnvironmentView,
    request:  MarchRequest
) {
  import MarchLabel._
  import m.formats._
  import m.program._

  private val offset   = Reg(SInt(sceneBits.W))
  private val position = Reg(SInt((sceneBits + 1).W))
  private val point    = Reg(Vec(3, SInt(sceneBits.W)))
  private val normal   = Reg(Vec(3, SInt(NumberFormats.normalBits.W)))

  /** On the axes so far, the point is nearer than the object's hit; on one of them, it is off the ray's origin. */
  private val isNearer = Reg(Bool())
  private val isAway   = Reg(Bool())

  private val distance  = m.quotient.zext
  private val mapNormal = Seq(texel.normal.x, texel.normal.y, texel.normal.z).map(_.integer)

  private val clamped   = SurfacePoint.clamped(position)
  private val travelled = Mux(offset < 0.S, ~offset, offset).asUInt // the length of the offset along its axis

  private val rotated = SurfacePoint.rotated(Rounding.narrow(m.sum, SurfacePoint.rotationBits))

  /** Connects the result, which is valid in `Finish`. */
  def result(to: MarchResult): Unit = {
    val isHit  = resolver.kind =/= HitKind.miss
    val isSeen = resolver.kind === HitKind.map && !stepper.isBehind
    to.albedo      := Mux(isHit, texel.albedo, 0.U.asTypeOf(texel.albedo))
    to.hidesObject := isSeen && isNearer && isAway
    for (axis <- 0 until 3) {
      to.point.axes(axis)  := Fixed(to.point.x.format, Mux(isHit, point(axis), 0.S))
      to.normal.axes(axis) := Mux(isHit, normal(axis), 0.S)
    }
  }

  /** Steps from `Point` to `Finish`. The normal is rotated while the distance is divided. */
  def describe(): Unit = {
    label(Point)
    overlap { at =>
      at(0) {
        set(isNearer, true.B)
        set(isAway, request.isFromCamera) // a camera stands on no surface
        await(texel.isReady, "texel")
      }
      for (axis <- 0 until 3) rotateNormal(at, axis, begin = 3 * axis)
    }
    m.awaitDivision(Seq(Way.when(!request.isFromCamera, "not from a camera")))
    addClippedWay()
    label(Way)
    overlap(at => for (axis <- 0 until 3) hitPoint(at, axis, begin = 2 * axis))
  }

  /** Adds the way from the camera to the frustum of the maps. */
  private def addClippedWay(): Unit = {
    val later = resolver.rateExponent +& -resolver.exponent
    step {
      m.load(distance)
      m.setShift((f + 1).S +& Mux(later > 0.S, later, 0.S))
    }
    step {
      set(offset, m.shifted)
      m.load(resolver.rateMantissa.zext)
      m.setShift((f + 1).S +& Mux(later < 0.S, -later, 0.S))
    }
    step(set(m.mantissa, m.sumMantissa))
    step {
      set(m.quotient, m.combine(offset, m.mantissa.zext).asUInt)
      set(resolver.exponent, Mux(later > 0.S, resolver.rateExponent, resolver.exponent) + 1.S)
    }
  }

  /** Six cycles. */
  private def hitPoint(at: Overlap[MarchLabel], axis: Int, begin: Int): Unit = {
    at(begin)(m.multiply(distance, request.ray.dir.axes(axis)))
    at(begin + 1)(m.load(m.product))
    at(begin + 2) {
      m.latchExponent()
      m.setShift(f.S - resolver.exponent)
    }
    at(begin + 3)(set(offset, m.summand))
    at(begin + 4) {
      set(position, m.combine(offset, request.ray.origin.axes(axis).integer))
      set(isNearer, isNearer && travelled +& view.occlusionTolerance < request.hitDistance)
      set(isAway, isAway || travelled > view.occlusionTolerance)
    }
    at(begin + 5)(set(point(axis), clamped))
  }

  /** Five cycles. */
  private def rotateNormal(at: Overlap[MarchLabel], axis: Int, begin: Int): Unit = {
    for (((component, factor), cycle) <- mapNormal.zip(view.rotation(axis).axes).zipWithIndex)
      at(begin + cycle)(m.multiply(component, factor.integer))
    at(begin + 1)(m.load(m.product))
    at(begin + 2)(m.accumulate())
    at(begin + 3)(m.accumulate())
    at(begin + 4)(set(normal(axis), rotated))
  }
}

object SurfacePoint {

  /** Bits of a sum of three products of a normal and a row of the rotation. */
  val rotationBits: Int = EnvironmentView.rotationBits + NumberFormats.normalBits + 2

  /** A component of the normal, from its sum. */
  def rotated(sum: SInt): SInt =
    Rounding.saturate(Rounding.nearestEven(sum, EnvironmentView.rotationFraction), NumberFormats.normalBits)

  /** A coordinate of `sceneBits` and one bit, clamped to half the scene's size. */
  def clamped(position: SInt): SInt = {
    val sceneBits = position.getWidth - 1
    val sign      = position(sceneBits)
    val isFar     = position(sceneBits - 1, sceneBits - 2) =/= Fill(2, sign)
    val max       = ((BigInt(1) << (sceneBits - 2)) - 1).S(sceneBits.W)
    Mux(isFar, Mux(sign, ~max, max), Rounding.narrow(position, sceneBits))
  }
}
