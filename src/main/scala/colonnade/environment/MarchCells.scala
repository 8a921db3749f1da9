package colonnade.environment

import chisel3._

/** Goes from cell to cell through a tile of several planes. */
final class MarchCells(
    m:       MarchDatapath,
    walk:    MarchWalk,
    planes:  MarchPlanes,
    axes:    MarchAxes,
    pixels:  MarchPixels,
    channel: AttributeChannel[CellQuestion, CellAnswer]
) {
  import m.formats._
  import m.program._

  /** Distances of the next cell's edges, with guard bits; a ray may go on by a cell beyond the farthest. */
  private val edge     = Reg(Vec(2, UInt((wayBits + 1).W)))
  private val isSecond = Reg(Bool())
  private val latest   = Reg(SInt(combineBits.W))

  private val question = channel.question

  /** Cells along a tile's edge are 4 or 8. */
  private val isFine = walk.tile.cellLog === (layout.tileLog - 3).U

  private def width(axis: UInt): UInt = Mux(isFine, axes.stride(axis) >> 3, axes.stride(axis) >> 2)

  private val isInside = walk.cell.map(cell => cell < Mux(isFine, 8.U, 4.U)).reduce(_ && _)

  /** Steps from the label "cells" on. */
  def describe(): Unit = {
    step("cells") {
      pixels.forCell()
      goto("pixel")
    }
    first()
    step("cell") {
      when(now)(question.valid := isInside)
      set(isSecond, edge(0) > edge(1))
      awaitOr(channel.question.ready || !isInside, !isInside -> "cells passed")
    }
    step {
      val next = edge(isSecond)
      set(walk.stop, Mux(next < walk.end, next, walk.end))
      set(planes.id, channel.answer.bits.content.ids(0))
      set(planes.purpose, planes.forCell)
      awaitOr(channel.answer.valid, channel.answer.valid -> "plane")
    }
    step("cell passed") {
      val axis = isSecond.asUInt
      set(walk.begin, walk.stop)
      set(edge(axis), m.combine(edge(axis).zext, width(axis).zext).asUInt)
      set(walk.cell(axis), Mux(axes.isNegative(axis), walk.cell(axis) - 1.U, walk.cell(axis) + 1.U))
      branch((walk.stop >= walk.end || walk.steps >= mostSteps.U) -> "cells passed", true.B -> "cell")
    }
    step("cells passed")(m.multiply(walk.end(wayBits - 1, guardBits).zext, m.way(2)))
    step {
      set(walk.there, m.combine(m.place(2), m.share))
      goto("tile passed")
    }
  }

  /** The cell that the ray comes into, and where it crosses its edges: so many cells before the tile's. */
  private def first(): Unit = {
    step("first cell") {
      val inTile = Seq(pixels.x, pixels.y).map(_(layout.tileLog - 1, 0))
      set(m.axis, 0.U)
      for (a <- 0 to 1) {
        val cell = Mux(isFine, inTile(a) >> (layout.tileLog - 3), inTile(a) >> (layout.tileLog - 2))
        set(walk.cell(a), cell)
      }
    }
    step("cell edge") {
      val cell = walk.cell(m.axis(0))
      val last = Mux(isFine, 7.U, 3.U)
      m.multiply(width(m.axis(0)).zext, Mux(axes.isNegative(m.axis), cell, last - cell).zext)
    }
    step(set(latest, m.combine(axes.edge(m.axis(0)).zext, m.product, subtract = true)))
    step {
      val isLater = latest > walk.begin.zext
      val next    = Mux(isLater, latest.asUInt(wayBits, 0), walk.begin)
      set(edge(m.axis(0)), Mux(m.way(m.axis) === 0.S, axes.farthest, next))
      set(m.axis, 1.U)
      branch((m.axis === 0.U) -> "cell edge", true.B -> "cell")
    }
  }
}
