package colonnade.environment

import chisel3._
import colonnade.formats.RoomView
import colonnade.numbers.Rounding

/** What the maps' own camera sees in a pixel: the plane of the pixel's cell gives the depth, nothing is marched along. */
final class MarchSeen(
    m:          MarchDatapath,
    projection: MarchProjection,
    planes:     MarchPlanes,
    pixels:     MarchPixels,
    texel:      MarchTexel,
    ends:       MarchEnds,
    channel:    AttributeChannel[CellQuestion, CellAnswer],
    view:       RoomView,
    request:    MarchRequest
) {
  import m.formats._
  import m.program._

  private val fallLength = Reg(UInt(lengthBits.W))
  private val isFalling  = Reg(Bool())
  private val cellPlane  = Reg(chiselTypeOf(planes.id))
  private val hasCell    = Reg(Bool())

  when(channel.answer.valid) {
    cellPlane := channel.answer.bits.content.ids(0)
    hasCell   := true.B
  }

  /** Steps from the label "seen" on; they go on at "point", or at "finish" where the maps show nothing. */
  def describe(): Unit = {
    label("seen")
    overlap { at =>
      coordinate(at, 0, request.ray.pixel.x, view.stepX, pixels.x)
      coordinate(at, 1, request.ray.pixel.y, view.stepY, pixels.y)
    }
    step {
      set(m.place(2), 0.S)
      set(m.axis, 2.U)
      set(planes.purpose, planes.forPixel)
      set(hasCell, false.B)
      when(now) {
        channel.question.valid                := true.B
        channel.question.bits.content.pixel.x := pixels.x
        channel.question.bits.content.pixel.y := pixels.y
      }
      await(channel.question.ready)
    }

    // How fast the ray's depth grows, while the cell's plane is looked up
    projection.describeTowards()
    step {
      m.measure()
      set(isFalling, m.sum > 0.S)
    }
    step {
      set(fallLength, m.length)
      set(m.mantissa, m.shifted.asUInt(f - 1, 0))
      set(planes.id, cellPlane)
      awaitOr(hasCell, (hasCell && !isFalling) -> "finish", hasCell -> "plane")
    }

    step("seen depth") {
      m.load(planes.depth.value)
      set(m.drop, planeFraction.S - planes.depth.exponent.zext)
    }
    step {
      m.load(m.shifted)
      branch((m.sum >= 0.S) -> "finish")
    }
    step {
      m.flip(true.B)
      texel.ask()
    }
    step {
      set(m.length, m.measured)
      set(m.drop, f.S)
    }
    step(set(m.way(0), m.saturated(alongBits)))

    // The way there: one by w times that
    step(m.multiply(m.way(0), m.mantissa.zext))
    step(m.load(m.product))
    step(m.measure())
    step {
      set(m.mantissa, m.shifted.asUInt(f - 1, 0))
      set(ends.exponent, (f + 1).S +& view.exponent - m.length.zext - fallLength.zext)
      set(ends.kind, RoomKind.map.U)
    }
    step {
      m.startDivision(m.one, m.mantissa)
      goto("point")
    }
  }

  /** (2 · pixel + 1) · step, in two digits: a place in the map, from its middle, and the map's pixel. Four cycles. */
  private def coordinate(at: Overlap, axis: Int, pixel: UInt, stepWidth: UInt, to: UInt): Unit = {
    val begin        = 2 * axis
    val halves       = ((pixel << 1) | 1.U).zext
    val digits       = projection.digitsOf(stepWidth.zext)
    val place        = Rounding.floor(m.sum, RoomView.stepGuard)
    val Seq(low, up) = if (digits.size == 1) Seq(digits.head, 0.S) else digits
    at(begin)(m.multiply(halves, up))
    at(begin + 1) {
      m.multiply(halves, low)
      m.load(m.product)
    }
    at(begin + 2)(m.descend())
    at(begin + 3) {
      val inMap = (place >> toPixel).asUInt
      set(to, Mux(inMap >= sizes(axis).U, (sizes(axis) - 1).U, inMap))
      set(m.place(axis), m.combine(place, m.constant(centre(axis)), subtract = true))
    }
  }
}
