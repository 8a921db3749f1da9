package colonnade.environment

import chisel3._
import chisel3.util.Decoupled
import colonnade.config.PathConfig
import colonnade.shading.EnvironmentSurface

/** A ray for a march, and what its path wants to know. */
final class MarchOrder(config: PathConfig) extends Bundle {
  val request     = new EnvironmentRequest(config)
  val ray         = new EnvironmentRay(config)
  val hitDistance = HitDistance(config) // for an occlusion test: the distance of its hit
}

/** What a ray has met. */
final class MarchAnswer(config: PathConfig) extends Bundle {
  val isHit           = Bool() // there is a point to shade; if the request was an occlusion test, it hides the hit
  val isOcclusionTest = Bool()
  val surface = new EnvironmentSurface(config) // the request's context; the point, if there is one
}

/** The path unit's port to the marches of its column. */
final class MarchPort(config: PathConfig) extends Bundle {

  /** For the pipeline of directly seen pixels; for the marches. At most one is accepted in a cycle. */
  val direct = Decoupled(new EnvironmentRequest(config))
  val march  = Decoupled(new EnvironmentRequest(config))

  val order = Output(new MarchOrder(config)) // the order, in the cycle after its request is accepted, and only then
  val answer = Flipped(Decoupled(new MarchAnswer(config))) // in any order

  /** Ties off a port without a requester. */
  def tieOff(): Unit = {
    for (req <- Seq(direct, march)) {
      req.valid := false.B
      req.bits  := DontCare
    }
    order        := DontCare
    answer.ready := true.B
  }
}
