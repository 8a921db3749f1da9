package colonnade.environment

import chisel3._

/** Goes from tile to tile. A tile of one plane is passed at once, and so is one of several if the ray is in front of all
  * of them; it is then in front of the least.
  */
final class MarchTiles(
    m:       MarchDatapath,
    walk:    MarchWalk,
    planes:  MarchPlanes,
    axes:    MarchAxes,
    channel: AttributeChannel[CellQuestion, CellAnswer]
) {
  import m.formats._
  import m.program._

  private val question = channel.question
  private val which    = Reg(UInt(2.W))
  private val scaled   = Reg(SInt(scaledBits.W))
  private val best     = Reg(SInt(scaledBits.W))
  private val bestId   = Reg(chiselTypeOf(planes.id))

  /** Steps from the label "tile" on; they go on at "shell" when the march finds nothing. */
  def describe(): Unit = {
    step("tile") {
      val isInside = axes.tile(0) < layout.tileColumns.U && axes.tile(1) < layout.tileRows.U
      when(now) {
        question.valid                  := isInside
        question.bits.content.pixel     := walk.tileCorner
        question.bits.content.wholeTile := true.B
      }
      set(walk.isSecond, axes.edge(0) > axes.edge(1))
      set(which, 0.U)
      awaitOr(question.ready || !isInside, !isInside -> "shell")
    }
    step {
      val answer = channel.answer.bits.content
      val isOne  = answer.count === 1.U
      set(walk.tile, answer)
      set(walk.stop, walk.end)
      set(planes.id, answer.ids(0))
      set(planes.purpose, Mux(isOne, planes.forTile, planes.forSurvey))
      awaitOr(
        channel.answer.valid,
        (channel.answer.valid && !isOne && walk.isBehind) -> "cells",
        channel.answer.valid                              -> "plane"
      )
    }
    survey()
    step("keep") {
      walk.keep(true.B)
      set(walk.steps, walk.steps + 1.U)
    }
    step("tile passed") {
      val most   = ((BigInt(1) << alongBits) - 1).S
      val isSeen = walk.there > 0.S && walk.there < most
      val isOver = walk.steps >= mostSteps.U || walk.end === axes.farthest || !isSeen
      val axis   = walk.isSecond.asUInt
      val next   = m.combine(axes.edge(axis).zext, axes.stride(axis).zext)
      set(walk.begin, walk.end)
      set(axes.edge(axis), Mux(next(wayBits), axes.farthest, next.asUInt(wayBits - 1, 0)))
      set(axes.tile(axis), Mux(axes.isNegative(axis), axes.tile(axis) - 1.U, axes.tile(axis) + 1.U))
      branch(isOver -> "shell", true.B -> "tile")
    }
  }

  /** The ray is in front of a plane of several: which one is the least where it leaves? */
  private def survey(): Unit = {
    step("survey") {
      m.load(walk.leaves)
      set(m.drop, planeFraction.S - planes.depth.exponent.zext)
    }
    step(set(scaled, m.shifted))
    step {
      val isLess = which === 0.U || scaled < best
      val isLast = which === walk.tile.count - 1.U
      set(best, scaled, isLess)
      set(bestId, planes.id, isLess)
      set(which, which + 1.U)
      set(planes.id, Mux(isLast, Mux(isLess, planes.id, bestId), walk.tile.ids(which + 1.U)))
      set(planes.purpose, planes.forKeeping, isLast)
      goto("plane")
    }
  }
}
