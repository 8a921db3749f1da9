package colonnade.environment

import chisel3._
import chisel3.util.Fill
import colonnade.config.NumberFormats
import colonnade.formats.RoomView
import colonnade.numbers.{Fixed, Rounding}

/** The point that a ray meets, from the way there and the ray's origin, and its normal turned into the object's space. */
final class MarchSurface(m: MarchDatapath, texel: MarchTexel, ends: MarchEnds, view: RoomView, request: MarchRequest) {
  import m.formats._
  import m.program._

  private val travelled = Reg(SInt(sceneBits.W))
  private val place     = Reg(SInt((sceneBits + 1).W))
  private val point     = Reg(Vec(3, SInt(sceneBits.W)))
  private val normal    = Reg(Vec(3, SInt(NumberFormats.normalBits.W)))

  private val travel    = m.quotient.zext
  private val mapNormal = Seq(texel.normal.x, texel.normal.y, texel.normal.z).map(_.integer)

  /** The point is as far away as half the scene reaches, at most. */
  private val farBits = sceneBits - 1
  private val limited = {
    val sign  = place(sceneBits)
    val isFar = place(sceneBits - 1, farBits - 1) =/= Fill(2, sign)
    val most  = ((BigInt(1) << (farBits - 1)) - 1).S(sceneBits.W)
    Mux(isFar, Mux(sign, ~most, most), Rounding.narrow(place, sceneBits))
  }
  private val turned = {
    val exact = Rounding.narrow(m.sum, RoomView.rotationBits + NumberFormats.normalBits + 2)
    Rounding.saturate(Rounding.nearestEven(exact, RoomView.rotationFraction), NumberFormats.normalBits)
  }

  /** Once the program is at "finish". */
  def result(to: MarchResult): Unit = {
    val isThere = ends.kind =/= RoomKind.nothing.U
    to.albedo := Mux(isThere, texel.albedo, 0.U.asTypeOf(texel.albedo))
    for (axis <- 0 until 3) {
      to.point.axes(axis)  := Fixed(to.point.x.format, Mux(isThere, point(axis), 0.S))
      to.normal.axes(axis) := Mux(isThere, normal(axis), 0.S)
    }
  }

  /** Steps from the label "point" on; they end at "finish". The normal is turned while the way to the point is divided. */
  def describe(): Unit = {
    label("point")
    overlap { at =>
      at(0)(await(texel.isThere))
      for (axis <- 0 until 3) turn(at, axis, begin = 3 * axis)
    }
    m.awaitDivision()
    overlap(at => for (axis <- 0 until 3) reach(at, axis, begin = 2 * axis))
  }

  /** Six cycles. */
  private def reach(at: Overlap, axis: Int, begin: Int): Unit = {
    at(begin)(m.multiply(travel, m.heading(axis)))
    at(begin + 1)(m.load(m.product))
    at(begin + 2) {
      set(m.length, m.measured)
      set(m.drop, f.S - ends.exponent)
    }
    at(begin + 3)(set(travelled, m.saturated(farBits)))
    at(begin + 4)(set(place, m.combine(travelled, request.ray.origin.axes(axis).integer)))
    at(begin + 5)(set(point(axis), limited))
  }

  /** Five cycles. */
  private def turn(at: Overlap, axis: Int, begin: Int): Unit = {
    for (((component, factor), cycle) <- mapNormal.zip(view.rotation(axis).axes).zipWithIndex)
      at(begin + cycle)(m.multiply(component, factor.integer))
    at(begin + 1)(m.load(m.product))
    at(begin + 2)(m.accumulate())
    at(begin + 3)(m.accumulate())
    at(begin + 4)(set(normal(axis), turned))
  }
}
