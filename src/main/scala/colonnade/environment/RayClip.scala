package colonnade.environment

import chisel3._
import chisel3.util.{Fill, MuxLookup, PriorityEncoder, Valid}
import colonnade.config.PathConfig
import colonnade.formats.EnvironmentView
import colonnade.numbers.Rounding

/** The camera's origin, projected into the map, and the planes of the maps' frustum that it is outside of. */
final class CameraOrigin(config: PathConfig) extends Bundle {
  private val formats = new MarchFormats(config.device)

  val origin   = Vec(3, SInt((formats.f + 1).W))
  val exponent = UInt(formats.exponentBits.W)
  val outside  = Vec(RayClip.planes, Bool())
}

/** A test of the camera's origin against a plane of the frustum. */
final class ClipTest(config: PathConfig) extends Bundle {
  private val formats = new MarchFormats(config.device)

  val origin    = Vec(3, SInt((formats.f + 1).W))
  val exponent  = UInt(formats.exponentBits.W)
  val plane     = UInt(3.W)
  val isOutside = Bool()
}

/** Moves the projected origin of a camera's ray along the ray into the frustum of the maps: to the last plane that the
  * ray enters through. The planes are the near plane, where w is 1, and those through the maps' camera and lines a
  * quarter of a pixel within the edges of the maps, so that a rounded origin is in the maps.
  *
  * [[HitResolver]] compares the ways to the planes, and keeps the longest one. All rays of a frame's camera have one
  * origin: once it is known, only the planes that it is outside of are tested.
  */
final class RayClip(
    m:        MarchOperations,
    stepper:  TileStepper,
    resolver: HitResolver,
    view:     EnvironmentView,
    camera:   Valid[CameraOrigin],
    test:     Valid[ClipTest]
) {
  import MarchLabel._
  import m.formats._
  import m.program._

  private val outside    = Reg(UInt(RayClip.planes.W)) // planes that the origin may be outside of
  private val index      = resolver.index
  private val isHigh     = index === 2.U || index === 4.U
  private val depth      = stepper.wExit               // beyond the near plane
  private val coordinate = stepper.depthEnter
  private val limit      = m.mantissa                  // of the coordinate in the plane at depth 1

  test.valid                                               := false.B
  test.bits.plane                                          := index
  test.bits.isOutside                                      := m.sum > 0.S
  test.bits.exponent                                       := m.uvwOriginExponent
  for ((to, from) <- test.bits.origin.zip(m.uvwOrigin)) to := Rounding.narrow(from, f + 1)

  /** In a step before `ProjectOrigin`, of a ray from the camera: takes over what is known of its origin. */
  def clear(): Unit = {
    set(outside, Mux(camera.valid, camera.bits.outside.asUInt, Fill(RayClip.planes, true.B)))
    set(resolver.rateMantissa, 0.U)
    set(resolver.rateExponent, RayClip.noWay.S)
  }

  /** The distance to the outside of the plane, or the approach to it, from the product with the limit. */
  private def setDistance(near: SInt, vector: Vec[SInt], isApproach: Boolean): Unit = {
    val value = Mux(index === 0.U, near, Mux(index <= 2.U, vector(0), vector(1)))
    val fine  = (value << (mapLog + RayClip.insetLog)).asSInt.pad(productBits)
    val isSum = if (isApproach) !isHigh else isHigh
    m.loadDifference(Mux(isSum, fine, m.product), Mux(isSum, m.product, fine))
  }

  /** Steps from `ClipPlane` on; they end at `OriginDepth`, or at `Finish` if the ray never enters. */
  def describe(): Unit = {
    step(ClipPlane) {
      val next   = PriorityEncoder(outside)
      val isOver = outside === 0.U
      val limits = Seq(BigInt(0)) ++ sizes.flatMap(size => Seq(BigInt(1), (BigInt(size) << RayClip.insetLog) - 1))
      set(limit, MuxLookup(next, 0.U)(limits.zipWithIndex.map { case (edge, plane) => plane.U -> edge.U }))
      set(index, next)
      set(outside, outside & (outside - 1.U))
      m.load(m.constant(1))
      m.setShift(m.uvwOriginExponent.zext -& view.exponent)
      branch(
        OriginDepth.when(isOver && !resolver.rateMantissa(f), "in the frustum"),
        MovedOrigin.when(isOver, "outside")
      )
    }
    step {
      m.multiply(m.uvwOrigin(2), limit.zext)
      set(depth, m.combine(m.uvwOrigin(2), m.shifted, subtract = true))
    }
    step {
      setDistance(depth, m.uvwOrigin, isApproach = false)
      m.multiply(m.projectedDir(2), limit.zext)
    }
    step {
      m.normalise()
      when(now)(test.valid := true.B)
      branch(ClipPlane.when(m.sum <= 0.S, "on the inner side"))
    }
    step {
      set(m.numerator, m.sumMantissa)
      set(m.exponents(0), m.exponent)
      setDistance(m.projectedDir(2), m.projectedDir, isApproach = true)
    }
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
}

object RayClip {
  val planes:   Int = 5     // near, left, right, top, bottom
  val insetLog: Int = 2     // log2 of the planes within a pixel
  val noWay:    Int = -1024 // the exponent of no way; less than any other
}
