package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, Decoupled}
import colonnade.config.ColonnadeConfig
import colonnade.shading.EnvironmentSurface

/** A ray for a march, and what its unit wants to know. */
final class MarchOrder(config: ColonnadeConfig) extends Bundle {
  val request = new EnvironmentRequest(config)
  val ray     = new EnvironmentRay(config)

  /** For an occlusion test: the distance of its hit. */
  val hitDistance = HitDistance(config)
}

/** What a ray has met. */
final class MarchAnswer(config: ColonnadeConfig) extends Bundle {

  /** There is a point to shade; if the request was an occlusion test, it hides the hit. */
  val isHit           = Bool()
  val isOcclusionTest = Bool()

  /** The request's context; the point, if there is one. */
  val surface = new EnvironmentSurface(config)
}

/** The number of a render unit in its column. */
object MarchRow {
  def apply(config: ColonnadeConfig): UInt = UInt(log2Ceil(config.array.rows.max(2)).W)
}

/** An order and the unit that it comes from. */
final class RowOrder(config: ColonnadeConfig) extends Bundle {
  val row   = MarchRow(config)
  val order = new MarchOrder(config)
}

/** An answer and the unit that it is for. */
final class RowAnswer(config: ColonnadeConfig) extends Bundle {
  val row    = MarchRow(config)
  val answer = new MarchAnswer(config)
}

/** A render unit's port to the marches of its column. */
final class MarchPort(config: ColonnadeConfig) extends Bundle {

  /** For the pipeline of directly seen pixels, if there is one; for the marches. At most one is accepted in a cycle. */
  val direct = Option.when(config.units.directView)(Decoupled(new EnvironmentRequest(config)))
  val march  = Decoupled(new EnvironmentRequest(config))

  /** The order, in the cycle after its request is accepted, and only then. */
  val order = Output(new MarchOrder(config))

  /** In any order. */
  val answer = Flipped(Decoupled(new MarchAnswer(config)))

  /** Ties off a port without a requester. */
  def tieOff(): Unit = {
    for (req <- direct.toSeq :+ march) {
      req.valid := false.B
      req.bits  := DontCare
    }
    order        := DontCare
    answer.ready := true.B
  }
}
