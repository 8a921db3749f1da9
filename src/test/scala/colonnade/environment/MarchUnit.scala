package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, Valid}
import colonnade.config.{AttributeLayout, PathConfig}
import colonnade.formats.EnvironmentView

/** A march, and the stages that complete its hits: from an order to its answer. */
class MarchUnit(config: PathConfig) extends Module {
  private val layout = AttributeLayout.of(config.device)

  val view      = IO(Input(new EnvironmentView(config.numbers)))
  val order     = IO(Flipped(Valid(new MarchOrder(config))))
  val isEmpty   = IO(Output(Bool()))
  val answer    = IO(Decoupled(new MarchAnswer(config)))
  val maps      = IO(new AttributePort(layout))
  val events    = IO(Output(new MarchEvents))
  val isIllegal = IO(Output(Bool()))

  /** On the way to the answer. */
  val hit      = IO(Valid(new MarchHit(config)))
  val distance = IO(Valid(new DirectDistance(config)))

  private val slot  = Module(new MarchSlot(config)).io
  private val hits  = Module(new MarchHits(config)).io
  private val point = Module(new DirectPoint(config)).io
  slot.view   := view
  slot.camera := 0.U.asTypeOf(slot.camera) // rays of a spec have different origins
  slot.order  := order
  isEmpty     := slot.isEmpty
  events      := slot.events
  isIllegal   := slot.events.illegal || hits.illegal
  hits.hit :<>= slot.hit
  hits.texel := slot.texel
  maps.cells <> slot.maps.cells
  maps.planes <> slot.maps.planes
  maps.albedo <> hits.albedo
  maps.normals <> hits.normals
  point.view := view
  MarchUnit.tieOff(point.sources(0))
  point.sources(1) :<>= hits.point
  answer :<>= point.answer

  hit.valid      := slot.hit.fire
  hit.bits       := slot.hit.bits.hit
  distance.valid := hits.point.distance.fire
  distance.bits  := hits.point.distance.bits
}

object MarchUnit {

  /** A source that never has a point. */
  def tieOff(source: PointSource): Unit = {
    for (part <- Seq(source.pixel, source.distance, source.albedo, source.normal)) {
      part.valid := false.B
      part.bits  := DontCare
    }
    source.origin := DontCare
  }
}
