package colonnade.environment

import chisel3._
import chisel3.util.Enum
import colonnade.microcode.Overlap
import colonnade.numbers.Rounding

/** Projects a point of the ray to a pixel, and clamps the pixel to a part of the map. */
final class HitPixel(m: MarchOperations, stepper: TileStepper, hitDistance: UInt) {
  import MarchLabel._
  import m.formats._
  import m.program._

  private val Seq(cell, visible, hidden) = Enum(3)
  private val purpose                    = Reg(UInt(2.W))
  private val coordinate                 = Rounding.narrow(m.lastCombined, depthBits) // of the step before

  val x: UInt = Reg(UInt(layout.xBits.W))
  val y: UInt = Reg(UInt(layout.yBits.W))

  private val at   = Mux(purpose === cell, stepper.enter, Mux(purpose === hidden, stepper.frontDistance, hitDistance))
  private val size = (1.U << Mux(purpose === cell, layout.tileLog.U, stepper.frontLog)) - 1.U

  /** In the step before a jump to `Pixel`: project the point where the ray enters the tile, and continue at `FirstCell`. */
  def forCell(): Unit = set(purpose, cell)

  /** In the step before `Pixel`: project the hit, and continue at `HitDistance`. */
  def forHit(): Unit = set(purpose, Mux(stepper.isBehind, hidden, visible))

  /** Steps from `Pixel` on, beside the steps that measure the hit's distance; for a cell they have no effect. */
  def describe(distance: Overlap[MarchLabel] => Unit): Unit = {
    label(Pixel)
    overlap { at =>
      distance(at)
      pixel(at)
    }
  }

  private def pixel(cycle: Overlap[MarchLabel]): Unit = {
    cycle(0)(m.multiply(at.zext, m.uvwDir(0)))
    cycle(1)(m.combineForNext(m.uvwOrigin(0), m.scaledProduct))
    cycle(2) {
      m.combineForNext(coordinate, m.constant(centre(0)))
      m.multiply(at.zext, m.uvwDir(1))
    }
    cycle(3) {
      set(x, clamp(stepper.tileCorner.x, stepper.frontCorner.x, sizes(0)))
      m.combineForNext(m.uvwOrigin(1), m.scaledProduct)
    }
    cycle(4)(m.combineForNext(coordinate, m.constant(centre(1))))
    cycle(5) {
      set(y, clamp(stepper.tileCorner.y, stepper.frontCorner.y, sizes(1)))
      branch(FirstCell.when(purpose === cell, "first cell"), HitDistance.otherwise)
    }
  }

  /** Clamps to the tile, to the part of the map that shows the last front plane, or to the map. */
  private def clamp(ofTile: UInt, ofPlane: UInt, mapSize: Int): UInt = {
    val pixel = (coordinate >> pixelFraction).asSInt
    val low   = Mux(purpose === visible, 0.U, Mux(purpose === cell, ofTile, ofPlane))
    val end   = low +& size
    val high  = Mux(purpose === visible || end >= mapSize.U, (mapSize - 1).U, end)
    Mux(pixel < low.zext, low, Mux(pixel > high.zext, high, pixel.asUInt))
  }
}
