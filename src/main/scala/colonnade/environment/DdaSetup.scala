package colonnade.environment

import chisel3._
import colonnade.microcode.Overlap

/** Set-up of the digital differential analyser (DDA) that walks through tiles: the ray's first tile, and along each
  * axis the distance to the first tile edge and from edge to edge.
  */
final class DdaSetup(m: MarchOperations, cells: CellReader) {
  import m.formats._
  import m.program._

  val tile: Vec[UInt] = Reg(Vec(2, UInt(tileBits.W))) // the current tile

  /** Distances with guard bits: to the next edge, and between edges. */
  val edge:   Vec[UInt] = Reg(Vec(2, UInt(distanceBits.W)))
  val stride: Vec[UInt] = Reg(Vec(2, UInt(distanceBits.W)))

  val isOutside: Bool = Reg(Bool()) // the origin is outside the map

  val maxDistance: UInt = ((BigInt(1) << distanceBits) - 1).U(distanceBits.W)

  private val tileWidth = pixelFraction + layout.tileLog
  private val remainder = Reg(UInt((tileWidth + 1).W))

  def isNegative(axis: UInt): Bool = m.uvwDir(axis | 0.U(2.W)) < 0.S

  /** The first tile, which is requested; then u and v relative to the map's centre. Three cycles. */
  def firstTile(at: Overlap[MarchLabel], begin: Int): Unit = {
    at(begin) {
      val coordinates = m.uvwOrigin.take(2)
      val pixels      = coordinates.map(p => (p >> pixelFraction).asSInt)
      val isInside    = pixels.zip(sizes).map { case (pixel, size) => pixel >= 0.S && pixel < size.S }.reduce(_ && _)
      set(isOutside, !isInside)
      for ((tile, p) <- tile.zip(coordinates))
        set(tile, p.asUInt(originBits - 1, tileWidth).pad(tileBits)(tileBits - 1, 0))
    }
    at(begin + 1)(when(now && !isOutside && cells.channel.isFree)(cells.requestTile(tile)))
    for (a <- 0 to 1)
      at(begin + 1 + a)(set(m.uvwOrigin(a), m.combine(m.uvwOrigin(a), m.constant(centre(a)), subtract = true)))
  }

  /** Steps between the projection and `Tile`. The second axis is normalised while the first one is divided. */
  def describe(): Unit = {
    overlap { at =>
      for (a <- 0 to 1) {
        at(2 * a)(m.loadSigned(m.uvwDir(a), m.uvwDir(a) < 0.S))
        at(2 * a + 1)(m.normalise())
        at(2 * a + 2)(set(m.exponents(a), m.exponent))
      }
      at(2)(m.startDivision(m.one, m.sumMantissa))
      at(4)(set(m.mantissa, m.sumMantissa))
      at(5)(remain(0))
      measure(at, 0, begin = 6)
      at(8)(m.startDivision(m.one, m.mantissa))
      at(9)(remain(1))
      measure(at, 1, begin = 11)
    }
  }

  /** The way to the tile's edge. */
  private def remain(axis: Int): Unit = {
    val offset = (BigInt(1) << tileWidth).U
    val inTile = (m.uvwOrigin(axis).asUInt + centre(axis).U)(tileWidth - 1, 0)
    set(remainder, Mux(m.uvwDir(axis) < 0.S, inTile, offset - inTile))
  }

  /** Distances from the reciprocal of the speed, as soon as it is there. Six cycles. */
  private def measure(at: Overlap[MarchLabel], axis: Int, begin: Int): Unit = {
    val isParallel = m.uvwDir(axis) === 0.S
    at(begin) {
      m.multiply(m.quotient.zext, remainder.zext)
      m.load((m.quotient << tileWidth).zext)
      m.awaitDivision()
    }
    at(begin + 1) {
      m.takeQuotient()
      measureDistance(axis)
    }
    at(begin + 2) {
      set(stride(axis), Mux(isParallel, maxDistance, m.distance))
      m.load(m.product)
    }
    at(begin + 3)(measureDistance(axis))
    at(begin + 4)(set(edge(axis), Mux(isParallel, maxDistance, m.distance)))
  }

  private def measureDistance(axis: Int): Unit = {
    m.latchExponent()
    m.setShift(m.exponents(axis).zext +& (f - 1 - guardBits).S)
  }
}
