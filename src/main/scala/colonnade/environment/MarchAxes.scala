package colonnade.environment

import chisel3._

/** Where a ray begins in the map, and when it crosses the tiles' edges: along each axis the distance to the first edge,
  * and from one to the next.
  */
final class MarchAxes(m: MarchDatapath) {
  import m.formats._
  import m.program._

  /** Of the tile. */
  val tile: Vec[UInt] = Reg(Vec(2, UInt(tileBits.W)))

  /** Distances with guard bits: of the next edge, and between edges. */
  val edge:   Vec[UInt] = Reg(Vec(2, UInt(wayBits.W)))
  val stride: Vec[UInt] = Reg(Vec(2, UInt(wayBits.W)))

  val farthest: UInt = ((BigInt(1) << wayBits) - 1).U(wayBits.W)

  private val tileWidth = toPixel + layout.tileLog
  private val isOutside = Reg(Bool())
  private val rest      = Reg(UInt((tileWidth + 1).W))

  private val coordinate = m.place.take(2).map(_.asUInt)
  private val speed      = m.way(m.axis)
  private val inTile     = VecInit(coordinate.map(_(tileWidth - 1, 0)))(m.axis(0))

  def isNegative(axis: UInt): Bool = m.way(axis | 0.U(2.W)) < 0.S

  /** Steps that end with the position counted from the map's middle; jumps if it is outside of the map. */
  def describe(outside: String): Unit = {
    step {
      val pixels = m.place.take(2).map(p => (p >> toPixel).asSInt)
      val within = pixels.zip(sizes).map { case (pixel, size) => pixel >= 0.S && pixel < size.S }
      set(isOutside, !within.reduce(_ && _))
      set(m.axis, 0.U)
      for (a <- 0 to 1) set(tile(a), coordinate(a)(placeBits - 1, tileWidth).pad(tileBits)(tileBits - 1, 0))
      branch(!within.reduce(_ && _) -> "middle")
    }
    step("axis") {
      m.load(speed)
      set(rest, Mux(speed < 0.S, inTile, (BigInt(1) << tileWidth).U - inTile))
      set(edge(m.axis(0)), farthest)
      set(stride(m.axis(0)), farthest)
      branch((speed === 0.S) -> "axis done")
    }
    step(m.flip(m.sum < 0.S))
    step(m.measure())
    step {
      set(m.mantissa, m.shifted.asUInt(f - 1, 0))
      set(m.lengths(0), m.length)
    }
    m.divide(m.one, m.mantissa)
    step(m.multiply(m.quotient.zext, rest.zext))
    step {
      m.load(m.product)
      m.multiply(m.quotient.zext, m.constant(BigInt(1) << tileWidth))
    }
    step(measureDistance())
    step {
      set(edge(m.axis(0)), m.saturatedNatural(wayBits))
      m.load(m.product)
    }
    step(measureDistance())
    step(set(stride(m.axis(0)), m.saturatedNatural(wayBits)))
    step("axis done") {
      set(m.axis, 1.U)
      branch((m.axis === 0.U) -> "axis")
    }
    step("middle")(set(m.place(0), m.combine(m.place(0), m.constant(centre(0)), subtract = true)))
    step {
      set(m.place(1), m.combine(m.place(1), m.constant(centre(1)), subtract = true))
      branch(isOutside -> outside)
    }
  }

  private def measureDistance(): Unit = {
    m.measure()
    set(m.drop, m.lengths(0).zext +& (f - 1 - guardBits).S)
  }
}
