package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, RegEnable, Valid}
import colonnade.config.{AttributeLayout, PathConfig}
import colonnade.formats.EnvironmentView

final class MarchSlotIO(config: PathConfig) extends Bundle {
  val view    = Input(new EnvironmentView(config.numbers)) // constant while a frame runs
  val order   = Flipped(Valid(new MarchOrder(config)))     // only in a cycle after one with `isEmpty`
  val isEmpty = Output(Bool())                             // no order is held
  val answer  = Decoupled(new MarchAnswer(config))
  val maps    = new AttributePort(AttributeLayout.of(config.device))
  val events  = Output(new MarchEvents)
}

/** An [[EnvironmentMarch]] with the order that it works on. */
final class MarchSlot(config: PathConfig) extends Module {
  val io = IO(new MarchSlotIO(config))

  private val march  = Module(new EnvironmentMarch(config))
  private val isHeld = RegInit(false.B)
  private val order  = RegEnable(io.order.bits, io.order.valid)
  when(io.order.valid) { isHeld := true.B }.elsewhen(march.io.request.ready) { isHeld := false.B }
  io.isEmpty := !isHeld

  march.io.view                      := io.view
  march.io.request.valid             := isHeld
  march.io.request.bits.context      := order.request.context
  march.io.request.bits.ray          := order.ray
  march.io.request.bits.isFromCamera := order.request.isDirectView
  march.io.request.bits.hitDistance  := order.hitDistance
  io.maps <> march.io.maps
  io.events := march.io.events

  private val result  = march.io.result
  private val surface = io.answer.bits.surface
  io.answer.valid                := result.valid
  io.answer.bits.isOcclusionTest := order.request.isOcclusionTest
  io.answer.bits.isHit           :=
    Mux(order.request.isOcclusionTest, result.bits.hidesObject, result.bits.kind =/= HitKind.miss)
  surface.context := result.bits.context
  surface.point   := result.bits.point
  surface.normal  := result.bits.normal
  surface.shadows := !order.request.isFresnelReflection
  private val albedo = result.bits.albedo
  surface.albedo.channels.zip(Seq(albedo.r, albedo.g, albedo.b)).foreach { case (to, from) => to := from }
  result.ready := io.answer.ready
}
