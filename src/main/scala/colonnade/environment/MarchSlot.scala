package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, RegEnable, Valid}
import colonnade.config.{AttributeLayout, PathConfig}
import colonnade.formats.EnvironmentView

/** A hit of a march, with its order. */
final class OrderedHit(config: PathConfig) extends Bundle {
  val hit   = new MarchHit(config)
  val order = new MarchOrder(config)
}

final class MarchSlotIO(config: PathConfig) extends Bundle {
  val view    = Input(new EnvironmentView(config.numbers)) // constant while a frame runs
  val camera  = Flipped(Valid(new CameraOrigin(config)))   // see [[EnvironmentMarchIO]]
  val order   = Flipped(Valid(new MarchOrder(config)))     // only in a cycle after one with `isEmpty`
  val isEmpty = Output(Bool())                             // no order is held
  val hit     = Decoupled(new OrderedHit(config))
  val texel   = Valid(new BoundingTexel)
  val maps    = new MarchMaps(AttributeLayout.of(config.device))
  val test    = Valid(new ClipTest(config))
  val events  = Output(new MarchEvents)
}

/** An [[EnvironmentMarch]] with the order that it works on. */
final class MarchSlot(config: PathConfig) extends Module {
  val io = IO(new MarchSlotIO(config))

  private val march  = Module(new EnvironmentMarch(config)).io
  private val isHeld = RegInit(false.B)
  private val order  = RegEnable(io.order.bits, io.order.valid)
  when(io.order.valid) { isHeld := true.B }.elsewhen(march.request.ready) { isHeld := false.B }
  io.isEmpty := !isHeld

  march.view                      := io.view
  march.camera                    := io.camera
  march.request.valid             := isHeld
  march.request.bits.ray          := order.ray
  march.request.bits.isFromCamera := order.request.isDirectView
  io.maps <> march.maps
  io.texel  := march.texel
  io.test   := march.test
  io.events := march.events

  io.hit.valid      := march.hit.valid
  io.hit.bits.hit   := march.hit.bits
  io.hit.bits.order := order
  march.hit.ready   := io.hit.ready
}
