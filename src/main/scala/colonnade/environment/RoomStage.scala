package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, RegEnable, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.RoomView
import colonnade.shading.RoomSurface

/** The ray of a context that may meet the room. */
final class RememberedRay(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val ray     = new RoomRay(config)
}

/** Ports of [[RoomStage]]. */
final class RoomStageIO(config: ColonnadeConfig) extends Bundle {

  /** Constant while a frame runs. */
  val view = Input(new RoomView(config.numbers))

  /** Remembered, in place of the context's last one. */
  val ray = Flipped(Valid(new RememberedRay(config)))

  /** Which point of the room does a context's ray meet? */
  val question = Flipped(Decoupled(new RoomQuestion(config)))

  /** The answer: a point to be lit, or a context whose ray meets nothing. */
  val surface = Decoupled(new RoomSurface(config))
  val nothing = Valid(Context(config))
  val maps    = new AttributePort(AttributeLayout.of(config), AttributePort.tagBits(config))
  val events  = Output(new MarchEvents)
}

/** Remembers every context's ray, and finds the points of the room that they meet: one at a time, see [[RoomMarch]]. */
final class RoomStage(config: ColonnadeConfig) extends Module {
  val io = IO(new RoomStageIO(config))

  private val march = Module(new RoomMarch(config))
  private val rays  = ContextTable(config, new RoomRay(config))
  when(io.ray.valid) { rays.write(io.ray.bits.context, io.ray.bits.ray) }

  // A ray is read in the cycle after its question, and held until the march takes it with its result
  private val isTaken  = RegInit(false.B)
  private val isHeld   = RegInit(false.B)
  private val question = RegEnable(io.question.bits, io.question.fire)
  private val read     = rays.read(io.question.bits.context, io.question.fire)
  private val held     = RegEnable(read, isTaken)
  io.question.ready := !isTaken && (!isHeld || march.io.request.ready)
  isTaken           := io.question.fire
  when(isTaken) { isHeld := true.B }.elsewhen(march.io.request.ready) { isHeld := false.B }

  march.io.view                 := io.view
  march.io.request.valid        := isHeld
  march.io.request.bits.context := question.context
  march.io.request.bits.isSeen  := question.isSeen
  march.io.request.bits.ray     := held
  io.maps <> march.io.maps
  io.events := march.io.events

  private val met     = march.io.result
  private val isThere = met.bits.kind =/= RoomKind.nothing.U
  io.surface.valid        := met.valid && isThere
  io.surface.bits.context := met.bits.context
  io.surface.bits.point   := met.bits.point
  io.surface.bits.normal  := met.bits.normal
  io.surface.bits.shadows := !question.isAside
  io.surface.bits.albedo.channels.zip(Seq(met.bits.albedo.r, met.bits.albedo.g, met.bits.albedo.b)).foreach {
    case (to, from) => to := from
  }
  io.nothing.valid := met.valid && !isThere
  io.nothing.bits  := met.bits.context
  met.ready        := !isThere || io.surface.ready
}
