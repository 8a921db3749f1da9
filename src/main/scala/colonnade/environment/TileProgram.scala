package colonnade.environment

import chisel3._
import colonnade.microcode.Repeat

/** Steps from tile to tile. A tile of one plane is tested at once. A tile of several planes is passed if the ray is in
  * front of all of them; the nearest one is then the last plane that the ray was in front of.
  */
final class TileProgram(
    m:       MarchOperations,
    stepper: TileStepper,
    planes:  PlaneCache,
    dda:     DdaSetup,
    first:   EarlyRequest,
    channel: AttributeChannel[CellRequest, CellResponse]
) {
  import MarchLabel._
  import m.formats._
  import m.program._

  private val req       = channel.req
  private val number    = Reg(UInt(2.W))
  private val nearest   = Reg(SInt(scaledBits.W))
  private val nearestId = Reg(chiselTypeOf(planes.id))

  /** Steps from `Tile` on; they end at `BoundingPlanes` if the ray hits nothing. */
  def describe(): Unit = {
    val resp = channel.resp
    first.drive(channel, request)
    when(resp.valid && first.isPending) {
      stepper.tile  := resp.bits.content
      first.hasCome := true.B
      planes.first.make()
    }
    step(Tile) {
      val isInside = dda.tile(0) < layout.tileColumns.U && dda.tile(1) < layout.tileRows.U
      val isMade   = first.isPending
      when(now && isInside && !isMade) {
        req.valid := true.B
        request(req.bits.content)
      }
      set(stepper.isSecondAxis, dda.edge(0) > dda.edge(1))
      set(number, 0.U)
      branch(
        BoundingPlanes.when(!isInside, "outside the map"),
        Repeat.until(req.ready || isMade, "cells.req is ready")
      )
    }
    step {
      val content = Mux(first.hasCome, stepper.tile, resp.bits.content)
      val isOne   = content.count === 1.U
      when(resp.valid || first.hasCome)(first.take())
      set(stepper.tile, content)
      set(stepper.tExit, stepper.tileExit)
      set(planes.id, content.ids(0))
      set(planes.purpose, Mux(isOne, planes.forTile, planes.forNearest))
      branch(
        Repeat.until(resp.valid || first.hasCome, "cells.resp"),
        Cells.when(!isOne && stepper.isBehind, "several planes, ray behind the map"),
        Plane.otherwise
      )
    }
    nearestPlane()
    step(RecordFront) {
      stepper.recordFront(true.B)
      stepper.countStep(true.B)
    }
    step(TilePassed) {
      val max     = ((BigInt(1) << alongBits) - 1).S
      val isInMap = stepper.wExit > 0.S && stepper.wExit < max
      val isOver  = stepper.steps >= maxSteps.U || stepper.tileExit === dda.maxDistance || !isInMap
      val axis    = stepper.isSecondAxis.asUInt
      val next    = m.combine(dda.edge(axis).zext, dda.stride(axis).zext)
      set(stepper.tEnter, stepper.tileExit)
      set(dda.edge(axis), Mux(next(distanceBits), dda.maxDistance, next.asUInt(distanceBits - 1, 0)))
      set(dda.tile(axis), Mux(dda.isNegative(axis), dda.tile(axis) - 1.U, dda.tile(axis) + 1.U))
      branch(BoundingPlanes.when(isOver, "beyond the map"), Tile.otherwise)
    }
  }

  private def request(content: CellRequest): Unit = {
    content.pixel     := stepper.tileCorner
    content.wholeTile := true.B
  }

  /** The ray is in front of one of several planes. Finds the plane that is nearest where the ray exits. */
  private def nearestPlane(): Unit = {
    step(NearestPlane) {
      m.load(stepper.depthExit)
      m.setShift(planeFraction.S - planes.depth.exponent.zext)
    }
    step(set(m.scaled, m.shifted))
    step {
      val isNearer = number === 0.U || m.scaled < nearest
      val isLast   = number === stepper.tile.count - 1.U
      set(nearest, m.scaled, isNearer)
      set(nearestId, planes.id, isNearer)
      set(number, number + 1.U)
      set(planes.id, Mux(isLast, Mux(isNearer, planes.id, nearestId), stepper.tile.ids(number + 1.U)))
      set(planes.purpose, planes.forFront, isLast)
      goto(Plane)
    }
  }
}
