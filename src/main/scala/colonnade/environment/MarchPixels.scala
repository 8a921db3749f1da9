package colonnade.environment

import chisel3._
import chisel3.util.Enum

/** Finds pixels along a ray, and keeps them within a part of the map. */
final class MarchPixels(m: MarchDatapath, walk: MarchWalk, met: UInt) {
  import m.formats._
  import m.program._

  private val Seq(cell, seen, hidden) = Enum(3)
  private val purpose                 = Reg(UInt(2.W))
  private val coordinate              = Reg(SInt(depthBits.W))

  val x: UInt = Reg(UInt(layout.xBits.W))
  val y: UInt = Reg(UInt(layout.yBits.W))

  private val at   = Mux(purpose === cell, walk.from, Mux(purpose === hidden, walk.keptAt, met))
  private val edge = (1.U << Mux(purpose === cell, layout.tileLog.U, walk.keptLog)) - 1.U

  /** In the step before a jump to "pixel", which goes on at "first cell" or "distance": the pixel where the ray comes into
    * the tile, or where it meets the room.
    */
  def forCell(): Unit = set(purpose, cell)

  def forResult(): Unit = set(purpose, Mux(walk.isBehind, hidden, seen))

  def describe(): Unit = {
    step("pixel")(m.multiply(at.zext, m.way(0)))
    step(set(coordinate, m.combine(m.place(0), m.share)))
    step {
      set(coordinate, m.combine(coordinate, m.constant(centre(0))))
      m.multiply(at.zext, m.way(1))
    }
    step {
      set(x, within(walk.tileCorner.x, walk.keptCorner.x, sizes(0)))
      set(coordinate, m.combine(m.place(1), m.share))
    }
    step(set(coordinate, m.combine(coordinate, m.constant(centre(1)))))
    step {
      set(y, within(walk.tileCorner.y, walk.keptCorner.y, sizes(1)))
      branch((purpose === cell) -> "first cell", true.B -> "distance")
    }
  }

  /** Of the tile, of the part that the last plane was seen in, or of the map. */
  private def within(ofTile: UInt, ofPlane: UInt, size: Int): UInt = {
    val pixel = (coordinate >> toPixel).asSInt
    val low   = Mux(purpose === seen, 0.U, Mux(purpose === cell, ofTile, ofPlane))
    val far   = low +& edge
    val high  = Mux(purpose === seen || far >= size.U, (size - 1).U, far)
    Mux(pixel < low.zext, low, Mux(pixel > high.zext, high, pixel.asUInt))
  }
}
