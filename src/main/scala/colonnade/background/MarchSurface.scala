package colonnade.background

import chisel3._
import chisel3.util.Fill
import colonnade.config.NumberFormats
import colonnade.formats.{AlbedoEntry, NormalEntry, RoomView}
import colonnade.numbers.{Fixed, Rounding}

/** What the point that a ray meets is made of, and where it is: its texel from the maps, or from the shell; the normal
  * turned into the object's space; the way there, from the ray's origin.
  */
final class MarchSurface(
    m:       MarchDatapath,
    planes:  MarchPlanes,
    pixels:  MarchPixels,
    ends:    MarchEnds,
    maps:    AttributePort,
    view:    RoomView,
    request: MarchRequest
) {
  import m.formats._
  import m.program._

  private val albedo     = Reg(new AlbedoEntry)
  private val mapNormal  = Reg(new NormalEntry)
  private val hasAlbedo  = Reg(Bool())
  private val hasNormal  = Reg(Bool())
  private val coordinate = Reg(SInt((sceneBits + 1).W))
  private val point      = Reg(Vec(3, SInt(sceneBits.W)))
  private val normal     = Reg(Vec(3, SInt(NumberFormats.normalBits.W)))

  maps.albedo.question.valid          := false.B
  maps.albedo.question.bits.tag       := 0.U
  maps.albedo.question.bits.content.x := pixels.x
  maps.albedo.question.bits.content.y := pixels.y
  maps.normals.question.valid         := false.B
  maps.normals.question.bits          := maps.albedo.question.bits

  /** Once the program is at "finish". */
  def result(to: MarchResult): Unit = {
    val isThere = ends.kind =/= RoomKind.nothing.U
    to.albedo := Mux(isThere, albedo, 0.U.asTypeOf(albedo))
    for (axis <- 0 until 3) {
      to.point.axes(axis)  := Fixed(to.point.x.format, Mux(isThere, point(axis), 0.S))
      to.normal.axes(axis) := Mux(isThere, normal(axis), 0.S)
    }
  }

  /** Steps from the label "point" on; they end at "finish". */
  def describe(): Unit = {
    ask()
    reach()
    turn()
  }

  /** Answers come while the place is worked out. */
  private def ask(): Unit = {
    when(maps.albedo.answer.valid) {
      albedo    := maps.albedo.answer.bits.content
      hasAlbedo := true.B
    }
    when(maps.normals.answer.valid) {
      mapNormal := maps.normals.answer.bits.content
      hasNormal := true.B
    }
    step("point") {
      set(hasAlbedo, false.B)
      set(hasNormal, false.B)
      branch((ends.kind === RoomKind.map.U) -> "texel")
    }
    step {
      planes.askShell(ends.entry)
      await(maps.planes.question.ready)
    }
    step {
      val entry = maps.planes.answer.bits.content
      set(albedo, entry.albedo)
      set(mapNormal, entry.normal)
      set(hasAlbedo, true.B)
      set(hasNormal, true.B)
      awaitOr(maps.planes.answer.valid, maps.planes.answer.valid -> "reach")
    }
    step("texel") {
      when(now)(maps.albedo.question.valid := true.B)
      await(maps.albedo.question.ready)
    }
    step {
      when(now)(maps.normals.question.valid := true.B)
      await(maps.normals.question.ready)
    }
  }

  /** The point is as far away as half the scene reaches, at most. */
  private def reach(): Unit = {
    val farBits = sceneBits - 1
    step("reach")(set(m.axis, 0.U))
    step("coordinate")(m.multiply(m.quotient.zext, m.heading(m.axis)))
    step(m.load(m.product))
    step {
      set(m.length, m.measured)
      set(m.drop, f.S - ends.exponent)
    }
    step(set(coordinate, m.saturated(farBits)))
    step(set(coordinate, m.combine(coordinate, VecInit(request.ray.origin.axes.map(_.integer))(m.axis))))
    step {
      val sign  = coordinate(sceneBits)
      val isFar = coordinate(sceneBits - 1, farBits - 1) =/= Fill(2, sign)
      val most  = ((BigInt(1) << (farBits - 1)) - 1).S(sceneBits.W)
      set(point(m.axis), Mux(isFar, Mux(sign, ~most, most), Rounding.narrow(coordinate, sceneBits)))
      set(m.axis, Mux(m.axis === 2.U, 0.U, m.axis + 1.U))
      branch((m.axis =/= 2.U) -> "coordinate")
    }
    step(await(hasAlbedo && hasNormal))
  }

  private def turn(): Unit = {
    val matrixRow = VecInit(view.rotation.map(row => VecInit(row.axes.map(_.integer))))(m.axis)
    val turned    =
      Rounding.nearestEven(
        Rounding.narrow(m.sum, RoomView.rotationBits + NumberFormats.normalBits + 2),
        RoomView.rotationFraction
      )
    step("turn")(m.multiply(mapNormal.x.integer, matrixRow(0)))
    step {
      m.multiply(mapNormal.y.integer, matrixRow(1))
      m.load(m.product)
    }
    step {
      m.multiply(mapNormal.z.integer, matrixRow(2))
      m.accumulate()
    }
    step(m.accumulate())
    step {
      set(normal(m.axis), Rounding.saturate(turned, NumberFormats.normalBits))
      set(m.axis, m.axis + 1.U)
      branch((m.axis =/= 2.U) -> "turn")
    }
  }
}
