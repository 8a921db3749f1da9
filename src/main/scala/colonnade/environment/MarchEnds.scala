package colonnade.environment

import chisel3._
import colonnade.formats.RoomView

/** How a march ends: at a point that the map shows, at the nearest plane of the shell, or nowhere. */
final class MarchEnds(
    m:      MarchDatapath,
    walk:   MarchWalk,
    planes: MarchPlanes,
    pixels: MarchPixels,
    texel:  MarchTexel,
    met:    UInt,
    view:   RoomView
) {
  import m.formats._
  import m.program._

  val kind:  UInt = Reg(UInt(RoomKind.bits.W))
  val entry: UInt = Reg(UInt(layout.shellIndexBits.W))

  /** The way to the point is the quotient · 2^exponent times the heading. */
  val exponent: SInt = Reg(SInt(exponentBits.W))

  private val index        = Reg(UInt(view.shellPlanes.getWidth.W))
  private val bestMantissa = Reg(UInt((f + 1).W))
  private val bestLength   = Reg(SInt(exponentBits.W))

  /** In a step: nothing is met yet. */
  def clear(): Unit = {
    set(kind, RoomKind.nothing.U)
    set(walk.isBehind, false.B)
    set(walk.hasPlane, false.B)
    set(walk.steps, 0.U)
    set(walk.begin, 0.U)
    set(exponent, 0.S)
    set(entry, 0.U)
    set(m.quotient, 0.U)
    set(pixels.x, 0.U)
    set(pixels.y, 0.U)
  }

  /** Once the program is at "finish". */
  def result(to: MarchResult): Unit = {
    val isMap     = kind === RoomKind.map.U
    val isNothing = kind === RoomKind.nothing.U
    to.kind           := kind
    to.x              := Mux(isMap, pixels.x, 0.U)
    to.y              := Mux(isMap, pixels.y, 0.U)
    to.entry          := entry
    to.isHidden       := isMap && walk.isBehind
    to.travel         := Mux(isNothing, 0.U, m.quotient)
    to.travelExponent := Mux(isNothing, 0.S, exponent)
    to.steps          := walk.steps
  }

  /** Steps after the label "meets": which pixel is it, and the way there, s / w in the direction's own length. */
  def describeMet(): Unit = {
    step("met") {
      pixels.forResult()
      goto("pixel")
    }
    step("distance") {
      m.multiply(met.zext, m.way(2))
      set(kind, RoomKind.map.U)
      texel.ask()
    }
    step(set(walk.there, m.combine(m.place(2), m.share)))
    step(m.load(Mux(walk.there < 1.S, 1.S, walk.there)))
    step(m.measure())
    step {
      set(m.mantissa, m.shifted.asUInt(f - 1, 0))
      set(m.lengths(0), m.length)
      m.load(met.zext)
    }
    step(m.measure())
    step {
      set(m.numerator, m.shifted.asUInt(f - 1, 0))
      set(exponent, m.length.zext +& (f.S +& view.exponent) - m.lengths(0).zext - m.towardsTop.zext)
    }
    step {
      m.startDivision(m.numerator, m.mantissa)
      set(exponent, exponent - m.wayTop.zext)
      goto("point")
    }
  }

  /** Steps from the label "shell" on: the nearest plane in front of the ray that it goes towards. */
  def describeShell(): Unit = {
    step("shell")(m.multiply(m.towards(2), m.constant(sizes(0))))
    step {
      m.multiply(m.towards(2), m.constant(sizes(1)))
      set(m.way(0), m.combine(m.towards(0), fromMiddle, subtract = true))
      set(planes.purpose, planes.forShell)
      set(index, 0.U)
    }
    step(set(m.way(1), m.combine(m.towards(1), fromMiddle, subtract = true)))
    step("shell plane") {
      set(planes.id, index)
      val isOver = index === view.shellPlanes || index === layout.config.shellPlanes.U
      branch(isOver -> "shell passed", true.B -> "plane")
    }
    step("shell depth") {
      branch((planes.depth.value <= 0.S || m.sum <= 0.S) -> "shell next")
    }
    step(m.measure())
    step {
      set(m.numerator, m.shifted.asUInt(f - 1, 0))
      set(m.lengths(0), m.length)
      m.load(planes.depth.value)
    }
    step(m.measure())
    step(set(m.mantissa, m.shifted.asUInt(f - 1, 0)))
    m.divide(m.numerator, m.mantissa)
    step {
      val mantissa = Mux(m.quotient(f), m.quotient, (m.quotient << 1)(f, 0))
      val length   = m.lengths(0).zext - m.length.zext +& Mux(m.quotient(f), (f + 1).S, f.S)
      val isFirst  = kind === RoomKind.nothing.U
      val isNearer = isFirst || length > bestLength || (length === bestLength && mantissa > bestMantissa)
      set(kind, RoomKind.shell.U)
      set(bestMantissa, mantissa, isNearer)
      set(bestLength, length, isNearer)
      set(entry, index, isNearer)
    }
    step("shell next") {
      set(index, index + 1.U)
      goto("shell plane")
    }
    step("shell passed") {
      val isNothing = kind === RoomKind.nothing.U
      texel.askShell(entry, !isNothing)
      awaitOr(isNothing || texel.isShellAsked, isNothing -> "finish")
    }
    step {
      m.startDivision(m.depthMantissa, (bestMantissa >> 1)(f - 1, 0))
      set(exponent, m.depthLength.zext +& m.placeTop.zext - bestLength - m.towardsTop.zext)
      goto("point")
    }
  }

  /** Half the map's size times the direction's depth, in map units. */
  private def fromMiddle: SInt = (m.product >> (mapLog + 1)).asSInt
}
