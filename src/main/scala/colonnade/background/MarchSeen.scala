package colonnade.background

import chisel3._
import colonnade.formats.RoomView
import colonnade.numbers.Rounding

/** What the maps' own camera sees in a pixel: the plane of the pixel's cell gives the depth, nothing is marched along. */
final class MarchSeen(
    m:          MarchDatapath,
    projection: MarchProjection,
    planes:     MarchPlanes,
    pixels:     MarchPixels,
    ends:       MarchEnds,
    channel:    AttributeChannel[CellQuestion, CellAnswer],
    view:       RoomView,
    request:    MarchRequest
) {
  import m.formats._
  import m.program._

  private val fallLength = Reg(UInt(lengthBits.W))

  /** Steps from the label "seen" on; they go on at "point", or at "finish" where the maps show nothing. */
  def describe(): Unit = {
    label("seen")
    coordinate(0, request.ray.pixel.x, view.stepX, pixels.x)
    coordinate(1, request.ray.pixel.y, view.stepY, pixels.y)
    step {
      set(m.place(2), 0.S)
      set(m.way(0), 0.S)
      set(m.way(1), 0.S)
      set(m.way(2), 0.S)
      set(planes.purpose, planes.forPixel)
      when(now) {
        channel.question.valid                := true.B
        channel.question.bits.content.pixel.x := pixels.x
        channel.question.bits.content.pixel.y := pixels.y
      }
      await(channel.question.ready)
    }
    step {
      set(planes.id, channel.answer.bits.content.ids(0))
      awaitOr(channel.answer.valid, channel.answer.valid -> "plane")
    }
    step("seen depth") {
      m.load(planes.depth.value)
      set(m.drop, planeFraction.S - planes.depth.exponent.zext)
    }
    step {
      m.load(m.shifted)
      branch((m.sum >= 0.S) -> "finish")
    }
    step(m.flip(true.B))
    step {
      set(m.length, m.measured)
      set(m.drop, f.S)
    }
    step(set(m.way(0), m.saturated(alongBits)))

    // How fast the ray's depth grows, times w
    projection.describeDepth()
    step {
      m.measure()
      branch((m.sum <= 0.S) -> "finish")
    }
    step {
      set(fallLength, m.length)
      m.multiply(m.way(0), m.shifted.asUInt(f - 1, 0).zext)
    }
    step(m.load(m.product))
    step(m.measure())
    step {
      set(m.mantissa, m.shifted.asUInt(f - 1, 0))
      set(ends.exponent, (f + 1).S +& view.exponent - m.length.zext - fallLength.zext)
      set(ends.kind, RoomKind.map.U)
    }
    m.divide(m.one, m.mantissa)
    step(goto("point"))
  }

  /** (2 · pixel + 1) · step, in two digits: a place in the map, from its middle, and the map's pixel. */
  private def coordinate(axis: Int, pixel: UInt, stepWidth: UInt, to: UInt): Unit = {
    val halves       = ((pixel << 1) | 1.U).zext
    val digits       = projection.digitsOf(stepWidth.zext)
    val place        = Rounding.floor(m.sum, RoomView.stepGuard)
    val Seq(low, up) = if (digits.size == 1) Seq(digits.head, 0.S) else digits
    step(m.multiply(halves, up))
    step {
      m.multiply(halves, low)
      m.load(m.product)
    }
    step(m.descend())
    step {
      val inMap = (place >> toPixel).asUInt
      set(to, Mux(inMap >= sizes(axis).U, (sizes(axis) - 1).U, inMap))
      set(m.place(axis), m.combine(place, m.constant(centre(axis)), subtract = true))
    }
  }
}
