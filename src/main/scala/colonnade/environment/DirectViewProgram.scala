package colonnade.environment

import chisel3._
import colonnade.formats.EnvironmentView
import colonnade.microcode.{Overlap, Repeat}
import colonnade.numbers.Rounding

/** Steps for a ray from the camera: the plane of the pixel's cell gives the depth, so no march is needed. */
final class DirectViewProgram(
    m:          MarchOperations,
    projection: RayProjection,
    planes:     PlaneCache,
    hitPixel:   HitPixel,
    texel:      TexelFetch,
    resolver:   HitResolver,
    channel:    AttributeChannel[CellRequest, CellResponse],
    view:       EnvironmentView,
    request:    MarchRequest
) {
  import MarchLabel._
  import m.formats._
  import m.program._

  /** The growth of the ray's depth. */
  private val rateExponent = Reg(UInt(exponentBits.W))
  private val isReceding   = Reg(Bool())
  private val cellPlane    = Reg(chiselTypeOf(planes.id))
  private val hasCell      = Reg(Bool())

  when(channel.resp.valid) {
    cellPlane := channel.resp.bits.content.ids(0)
    hasCell   := true.B
  }

  /** Steps from `DirectView` on; they end at `Point`, or at `Finish` if the map shows nothing. */
  def describe(): Unit = {
    label(DirectView)
    overlap { at =>
      mapCoordinate(at, 0, request.ray.pixel.x, view.stepX, hitPixel.x)
      mapCoordinate(at, 1, request.ray.pixel.y, view.stepY, hitPixel.y)
    }
    step {
      set(m.uvwOrigin(2), 0.S)
      projection.selectRow(2.U)
      set(planes.purpose, planes.forDirectView)
      set(hasCell, false.B)
      when(now) {
        channel.req.valid                := true.B
        channel.req.bits.content.pixel.x := hitPixel.x
        channel.req.bits.content.pixel.y := hitPixel.y
      }
      await(channel.req.ready, "cells.req is ready")
    }

    // The growth of the ray's depth, while the cell's plane is looked up
    projection.describeDirRow()
    step {
      m.normalise()
      set(isReceding, m.sum > 0.S)
    }
    step {
      set(rateExponent, m.exponent)
      set(m.mantissa, m.sumMantissa)
      set(planes.id, cellPlane)
      branch(Repeat.until(hasCell, "cells.resp"), Finish.when(!isReceding, "not away from the camera"), Plane.otherwise)
    }

    step(DirectViewDepth) {
      m.load(planes.depth.value)
      m.setShift(planeFraction.S - planes.depth.exponent.zext)
    }
    step {
      m.load(m.shifted)
      branch(Finish.when(m.sum >= 0.S, "behind the camera"))
    }
    step {
      m.negate(true.B)
      texel.requestPixel()
    }
    step {
      m.latchExponent()
      m.setShift(f.S)
    }
    step(set(m.uvwDir(0), m.coordinate))

    // The distance: 1 / (w · rate)
    step(m.multiply(m.uvwDir(0), m.mantissa.zext))
    step(m.load(m.product))
    step(m.normalise())
    step {
      set(m.mantissa, m.sumMantissa)
      set(resolver.exponent, (f + 1).S +& view.exponent - m.exponent.zext - rateExponent.zext)
      set(resolver.kind, HitKind.map.U)
    }
    step {
      m.startDivision(m.one, m.mantissa)
      goto(Point)
    }
  }

  /** (2 · pixel + 1) · step, in two digits: a coordinate relative to the map's centre, and the map's pixel. Four cycles. */
  private def mapCoordinate(at: Overlap[MarchLabel], axis: Int, pixel: UInt, stepWidth: UInt, to: UInt): Unit = {
    val begin          = 2 * axis
    val halfPixels     = ((pixel << 1) | 1.U).zext
    val digits         = projection.digitsOf(stepWidth.zext)
    val coordinate     = Rounding.floor(m.sum, EnvironmentView.stepGuard)
    val Seq(low, high) = if (digits.size == 1) Seq(digits.head, 0.S) else digits
    at(begin)(m.multiply(halfPixels, high))
    at(begin + 1) {
      m.multiply(halfPixels, low)
      m.load(m.product)
    }
    at(begin + 2)(m.shiftAccumulate())
    at(begin + 3) {
      val inMap = (coordinate >> pixelFraction).asUInt
      set(to, Mux(inMap >= sizes(axis).U, (sizes(axis) - 1).U, inMap))
      set(m.uvwOrigin(axis), m.combine(coordinate, m.constant(centre(axis)), subtract = true))
    }
  }
}
