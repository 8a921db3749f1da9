package colonnade.environment

import chisel3._
import chisel3.util.MuxLookup
import colonnade.formats.EnvironmentView

/** Moves the projected origin of a camera's ray along the ray into the frustum of the maps: to the last plane that the ray
  * enters through. The planes are the near plane, where w is 1, and those through the maps' camera and lines a
  * quarter of a pixel within the edges of the maps, so that a rounded origin is in the maps.
  *
  * [[HitResolver]] compares the ways to the planes, and keeps the longest one.
  */
final class RayClip(m: MarchOperations, stepper: TileStepper, resolver: HitResolver, view: EnvironmentView) {
  import MarchLabel._
  import m.formats._
  import m.program._

  private val index      = resolver.index
  private val isHigh     = index === 2.U || index === 4.U
  private val depth      = stepper.wExit      // beyond the near plane
  private val coordinate = stepper.depthEnter // of origin or direction; the way of the origin
  private val limit      = m.mantissa         // of the coordinate in the plane at depth 1

  private def byAxis(near: SInt, vector: Vec[SInt]): SInt =
    Mux(index === 0.U, near, Mux(index <= 2.U, vector(0), vector(1)))

  /** Steps from `NearPlane` on; they end at `OriginDepth`, or at `Finish` if the ray never enters. */
  def describe(): Unit = {
    step(NearPlane) {
      m.load(m.constant(1))
      m.setShift(m.uvwOriginExponent.zext - view.exponent)
      set(index, 0.U)
      set(resolver.rateMantissa, 0.U)
      set(resolver.rateExponent, RayClip.noWay.S)
    }
    step(set(depth, m.shifted))
    step(set(depth, m.combine(m.uvwOrigin(2), depth, subtract = true)))
    step(ClipPlane) {
      val limits = Seq(BigInt(0)) ++ sizes.flatMap(size => Seq(BigInt(1), (BigInt(size) << RayClip.insetLog) - 1))
      set(limit, MuxLookup(index, 0.U)(limits.zipWithIndex.map { case (edge, plane) => plane.U -> edge.U }))
      signed(byAxis(depth, m.uvwOrigin))
      val isOver = index === RayClip.planes.U
      branch(
        OriginDepth.when(isOver && !resolver.rateMantissa(f), "in the frustum"),
        MovedOrigin.when(isOver, "outside")
      )
    }
    step {
      m.multiply(m.uvwOrigin(2), limit.zext)
      m.load((coordinate << (mapLog + RayClip.insetLog)).asSInt)
    }
    step {
      m.accumulate(isHigh)
      m.multiply(m.projectedDir(2), limit.zext)
    }
    step {
      m.normalise()
      signed(byAxis(m.projectedDir(2), m.projectedDir), isDirection = true)
      branch(NextBoundingPlane.when(m.sum <= 0.S, "on the inner side"))
    }
    step {
      set(m.numerator, m.sumMantissa)
      set(m.exponents(0), m.exponent)
      m.load((coordinate << (mapLog + RayClip.insetLog)).asSInt)
    }
    step(m.accumulate(!isHigh))
    step {
      m.normalise()
      branch(Finish.when(m.sum <= 0.S, "never enters"), Rate.otherwise)
    }
    label(MovedOrigin)
    overlap { at =>
      for (axis <- 0 until 3) {
        val begin = 2 * axis
        at(begin)(m.multiply(m.projectedDir(axis), resolver.rateMantissa.zext))
        at(begin + 1)(m.load(m.product))
        at(begin + 2) {
          m.latchExponent()
          m.setShift((3 * f + 1).S - resolver.rateExponent)
        }
        at(begin + 3)(set(coordinate, m.coordinate))
        at(begin + 4)(set(m.uvwOrigin(axis), m.combine(m.uvwOrigin(axis), coordinate)))
      }
      at(8) {
        set(
          resolver.rateExponent,
          resolver.rateExponent +& m.uvwOriginExponent.zext - m.projectedDirExponent.zext - (2 * f + 1).S
        )
        goto(OriginDepth)
      }
    }
  }

  /** In a step: the coordinate with the sign by which its plane's distance to the outside, or from it, is a sum. */
  private def signed(value: SInt, isDirection: Boolean = false): Unit = {
    val isPositive = if (isDirection) !isHigh else isHigh
    set(coordinate, m.combine(Mux(isPositive, value, 0.S), Mux(isPositive, 0.S, value), subtract = true))
  }
}

object RayClip {
  val planes:   Int = 5     // near, left, right, top, bottom
  val insetLog: Int = 2     // log2 of the planes within a pixel
  val noWay:    Int = -1024 // the exponent of no way; less than that of any way
}
