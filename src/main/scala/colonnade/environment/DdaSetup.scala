package colonnade.environment

import chisel3._

/** Set-up of the digital differential analyser (DDA) that walks through tiles: the ray's first tile, and along each axis
  * the distance to the first tile edge and from edge to edge.
  */
final class DdaSetup(m: MarchOperations) {
  import MarchLabel._
  import m.formats._
  import m.program._

  val tile: Vec[UInt] = Reg(Vec(2, UInt(tileBits.W))) // the current tile

  /** Distances with guard bits: to the next edge, and between edges. */
  val edge:   Vec[UInt] = Reg(Vec(2, UInt(distanceBits.W)))
  val stride: Vec[UInt] = Reg(Vec(2, UInt(distanceBits.W)))

  val maxDistance: UInt = ((BigInt(1) << distanceBits) - 1).U(distanceBits.W)

  private val tileWidth   = pixelFraction + layout.tileLog
  private val isOutside   = Reg(Bool())
  private val remainder   = Reg(UInt((tileWidth + 1).W))
  private val coordinates = m.uvwOrigin.take(2).map(_.asUInt)
  private val speed       = m.uvwDir(m.axis)
  private val inTile      = VecInit(coordinates.map(_(tileWidth - 1, 0)))(m.axis(0))

  def isNegative(axis: UInt): Bool = m.uvwDir(axis | 0.U(2.W)) < 0.S

  /** Steps that end with u and v relative to the map's centre; then at `BoundingPlanes` if the origin is outside the map. */
  def describe(): Unit = {
    step(FirstTile) {
      val pixels = m.uvwOrigin.take(2).map(p => (p >> pixelFraction).asSInt)
      val within = pixels.zip(sizes).map { case (pixel, size) => pixel >= 0.S && pixel < size.S }
      set(isOutside, !within.reduce(_ && _))
      set(m.axis, 0.U)
      for (a <- 0 to 1) set(tile(a), coordinates(a)(originBits - 1, tileWidth).pad(tileBits)(tileBits - 1, 0))
      branch(Centre.when(!within.reduce(_ && _), "outside the map"))
    }
    step(AxisSetup) {
      m.load(speed)
      set(remainder, Mux(speed < 0.S, inTile, (BigInt(1) << tileWidth).U - inTile))
      set(edge(m.axis(0)), maxDistance)
      set(stride(m.axis(0)), maxDistance)
      branch(NextAxis.when(speed === 0.S, "parallel to the axis"))
    }
    step(m.negate(m.sum < 0.S))
    step(m.normalise())
    step {
      set(m.mantissa, m.sumMantissa)
      set(m.exponents(0), m.exponent)
    }
    m.divide(m.one, m.mantissa)
    step(m.multiply(m.quotient.zext, remainder.zext))
    step {
      m.load(m.product)
      m.multiply(m.quotient.zext, m.constant(BigInt(1) << tileWidth))
    }
    step(measureDistance())
    step {
      set(edge(m.axis(0)), m.distance)
      m.load(m.product)
    }
    step(measureDistance())
    step(set(stride(m.axis(0)), m.distance))
    step(NextAxis) {
      set(m.axis, 1.U)
      branch(AxisSetup.when(m.axis === 0.U, "second axis"))
    }
    step(Centre)(set(m.uvwOrigin(0), m.combine(m.uvwOrigin(0), m.constant(centre(0)), subtract = true)))
    step {
      set(m.uvwOrigin(1), m.combine(m.uvwOrigin(1), m.constant(centre(1)), subtract = true))
      branch(BoundingPlanes.when(isOutside, "outside the map"))
    }
  }

  private def measureDistance(): Unit = {
    m.latchExponent()
    m.setShift(m.exponents(0).zext +& (f - 1 - guardBits).S)
  }
}
