package colonnade.environment

import chisel3._
import colonnade.microcode.Repeat

/** Steps from cell to cell through a tile of several planes. */
final class CellProgram(
    m:        MarchOperations,
    stepper:  TileStepper,
    planes:   PlaneCache,
    dda:      DdaSetup,
    hitPixel: HitPixel,
    cells:    CellReader
) {
  import MarchLabel._
  import m.formats._
  import m.program._

  /** Distances to the next cell edges, with guard bits. A ray may go one cell beyond the largest distance. */
  private val edge         = Reg(Vec(2, UInt((distanceBits + 1).W)))
  private val isSecondAxis = Reg(Bool())

  /** A value by the log2 of a tile's cells along each edge: 2, 3 or 4. */
  private def byCells(value: Int => UInt): UInt = {
    def has(log: Int): Bool = stepper.tile.cellLog === (layout.tileLog - log).U
    Mux(has(4), value(4), Mux(has(3), value(3), value(2)))
  }

  private def width(axis: UInt): UInt = byCells(dda.stride(axis) >> _)

  private def isInTile(cell: Seq[UInt]): Bool = cell.map(_ < byCells(log => (1 << log).U)).reduce(_ && _)

  /** The cell behind the edge that the ray crosses first. */
  private val nextCell = stepper.cell.zipWithIndex.map { case (cell, a) =>
    Mux(isSecondAxis === (a == 1).B, Mux(dda.isNegative(a.U), cell - 1.U, cell + 1.U), cell)
  }

  /** Steps from `Cells` on. */
  def describe(): Unit = {
    step(Cells) {
      when(now)(cells.channel.drop())
      hitPixel.forCell()
      goto(Pixel)
    }
    firstCell()
    step(Cell) {
      val isInside = isInTile(stepper.cell)
      when(now && isInside && !cells.channel.isPending && cells.channel.isFree)(cells.requestCell(stepper.cellCorner))
      set(isSecondAxis, edge(0) > edge(1))
      branch(
        CellsPassed.when(!isInside, "outside the tile"),
        Repeat.until(cells.channel.isPending || cells.channel.isFree, "a dropped response")
      )
    }
    step {
      val next        = edge(isSecondAxis)
      val isAvailable = cells.channel.isAvailable
      when(now && isAvailable) {
        cells.take()
        when(isInTile(nextCell) && next < stepper.tileExit)(cells.requestCell(stepper.cornerOf(nextCell)))
      }
      set(stepper.tExit, Mux(next < stepper.tileExit, next, stepper.tileExit))
      set(planes.id, cells.content.ids(0))
      set(planes.purpose, planes.forCell)
      branch(Repeat.until(isAvailable, "cells.resp"), Plane.otherwise)
    }
    step(CellPassed) {
      val axis = isSecondAxis.asUInt
      set(stepper.tEnter, stepper.tExit)
      set(edge(axis), m.combine(edge(axis).zext, width(axis).zext).asUInt)
      for ((cell, next) <- stepper.cell.zip(nextCell)) set(cell, next)
      val isOver = stepper.tExit >= stepper.tileExit || stepper.steps >= maxSteps.U
      branch(CellsPassed.when(isOver, "end of the tile"), Cell.otherwise)
    }
    step(CellsPassed) {
      when(now)(cells.channel.drop())
      m.multiply(stepper.tileExit(distanceBits - 1, guardBits).zext, m.uvwDir(2))
    }
    step {
      when(now && cells.channel.isFree && cells.isInMap(stepper.nextTile))(cells.requestTile(stepper.nextTile))
      set(stepper.wExit, m.combine(m.uvwOrigin(2), m.scaledProduct))
      goto(TilePassed)
    }
  }

  /** The cell where the ray enters, and the distances to its edges: a number of cells before the tile's edges. */
  private def firstCell(): Unit = {
    step(FirstCell) {
      val inTile = Seq(hitPixel.x, hitPixel.y).map(_(layout.tileLog - 1, 0))
      set(m.axis, 0.U)
      for (a <- 0 to 1) set(stepper.cell(a), byCells(log => inTile(a) >> (layout.tileLog - log)))
    }
    val left = {
      val cell = stepper.cell(m.axis(0))
      val last = byCells(log => ((1 << log) - 1).U)
      // To the last cell, last - cell, without a carry before the multiplier
      (cell ^ Mux(dda.isNegative(m.axis(0)), 0.U, last)).zext
    }
    val half = (distanceBits - 2) / 2
    step(CellEdge)(m.multiply(width(m.axis(0))(half - 1, 0).zext, left))
    step {
      m.combineForNext(dda.edge(m.axis(0)).zext, m.product, subtract = true)
      m.multiply((width(m.axis(0)) >> half).zext, left)
    }
    step(m.combineForNext(m.lastCombined, (m.product << half).asSInt, subtract = true))
    step {
      val firstEdge = m.lastCombined
      val isAhead   = firstEdge > stepper.tEnter.zext
      val next      = Mux(isAhead, firstEdge.asUInt(distanceBits, 0), stepper.tEnter)
      set(edge(m.axis(0)), Mux(m.uvwDir(m.axis) === 0.S, dda.maxDistance, next))
      set(m.axis, 1.U)
      branch(CellEdge.when(m.axis === 0.U, "second axis"), Cell.otherwise)
    }
  }
}
