package colonnade.environment

import chisel3._
import chisel3.util.Valid
import colonnade.microcode.Repeat

/** Steps from tile to tile. A tile of one plane is tested at once. A tile of several planes is passed if the ray is in
  * front of all of them; the nearest one is then the last plane that the ray was in front of.
  */
final class TileProgram(
    m:       MarchOperations,
    stepper: TileStepper,
    planes:  PlaneCache,
    dda:     DdaSetup,
    cells:   CellReader
) {
  import MarchLabel._
  import m.formats._
  import m.program._

  private val number    = Reg(UInt(2.W))
  private val nearest   = Reg(SInt(scaledBits.W))
  private val nearestId = Reg(chiselTypeOf(planes.id))

  /** The plane that is likely to be looked up next: of the same tile, or of the next tile or cell. */
  def nextPlane: Valid[UInt] = {
    val next      = Wire(Valid(chiselTypeOf(planes.id)))
    val isInTile  = planes.purpose === planes.forNearest && number +& 1.U < stepper.tile.count
    val isForCell = cells.channel.isStored && planes.purpose =/= planes.forBoundingPlane
    next.valid := isInTile || isForCell
    next.bits  := Mux(isInTile, stepper.tile.ids(number + 1.U), cells.channel.stored.content.ids(0))
    next
  }

  /** Steps from `Tile` on; they end at `BoundingPlanes` if the ray hits nothing. */
  def describe(): Unit = {
    step(Tile) {
      val isInside = cells.isInMap(dda.tile)
      when(now && isInside && !cells.channel.isPending && cells.channel.isFree)(cells.requestTile(dda.tile))
      set(stepper.isSecondAxis, dda.edge(0) > dda.edge(1))
      set(number, 0.U)
      branch(
        BoundingPlanes.when(!isInside, "outside the map"),
        Repeat.until(cells.channel.isPending || cells.channel.isFree, "a dropped response")
      )
    }
    step {
      val isOne       = cells.content.count === 1.U
      val byCells     = !isOne && stepper.isBehind
      val isAvailable = cells.channel.isAvailable
      when(now && isAvailable) {
        cells.take()
        when(!byCells && cells.isInMap(stepper.nextTile))(cells.requestTile(stepper.nextTile))
      }
      // While it waits, nothing must name planes to look ahead to
      set(stepper.tile, cells.content)
      set(stepper.tExit, stepper.tileExit)
      set(planes.id, cells.content.ids(0))
      set(planes.purpose, Mux(isOne, planes.forTile, planes.forNearest), isAvailable)
      branch(
        Repeat.until(isAvailable, "cells.resp"),
        Cells.when(byCells, "several planes, ray behind the map"),
        Plane.otherwise
      )
    }
    nearestPlane()
    step(TilePassed) {
      stepper.recordFront(planes.purpose === planes.forFront)
      val max     = ((BigInt(1) << alongBits) - 1).S
      val isInMap = stepper.wExit > 0.S && stepper.wExit < max
      val isOver  = stepper.steps >= maxSteps.U || stepper.tileExit === dda.maxDistance || !isInMap
      val axis    = stepper.isSecondAxis.asUInt
      val next    = m.combine(dda.edge(axis).zext, dda.stride(axis).zext)
      set(stepper.tEnter, stepper.tileExit)
      set(dda.edge(axis), Mux(next(distanceBits), dda.maxDistance, next.asUInt(distanceBits - 1, 0)))
      for ((tile, next) <- dda.tile.zip(stepper.nextTile)) set(tile, next)
      branch(BoundingPlanes.when(isOver, "beyond the map"), Tile.otherwise)
    }
  }

  /** The ray is in front of one of several planes. Finds the plane that is nearest where the ray exits. */
  private def nearestPlane(): Unit = {
    step(NearestPlane) {
      // In steps of w
      val wide = (stepper.depthExit << planes.depth.exponent).asSInt
      set(m.scaled, (wide >> (planeFraction - f)).asSInt)
    }
    step {
      val isNearer = number === 0.U || m.scaled < nearest
      val isLast   = number === stepper.tile.count - 1.U
      set(nearest, m.scaled, isNearer)
      set(nearestId, planes.id, isNearer)
      set(number, number + 1.U)
      set(planes.id, Mux(isLast, Mux(isNearer, planes.id, nearestId), stepper.tile.ids(number + 1.U)))
      set(planes.purpose, planes.forFront, isLast)
      stepper.countStep(isLast)
      branch(TilePassed.when(isLast && isNearer, "the last one is the nearest"), Plane.otherwise)
    }
  }
}
