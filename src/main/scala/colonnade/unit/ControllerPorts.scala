package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, Valid}
import colonnade.common.Context
import colonnade.config.ColonnadeConfig
import colonnade.environment.RoomQuestion

/** A context whose hit has been shaded. */
final class Shaded(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)

  /** By light, of a surface that ends the path. */
  val needsShadowRays = Vec(config.frame.lights, Bool())
}

/** A context whose path goes on from a mirror or glass. */
final class Bounced(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)

  /** The ray meets the object's records; otherwise the background only. */
  val isTraced = Bool()
}

/** A context whose path may turn now. */
final class PathAside(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)

  /** What lies beside it is the background. */
  val isBackground = Bool()
}

/** What rays do that meet nothing of the object, where there may be a room. */
final class RoomControl(config: ColonnadeConfig) extends Bundle {

  /** There is a room in this frame. */
  val isThere = Input(Bool())

  /** A ray that cannot meet the object; a reflection beside a path that goes on, which waits. */
  val passes = Flipped(Valid(Context(config)))
  val aside  = Flipped(Valid(Context(config)))

  /** A context to meet the room; one that has, and is in the shader; one that has met nothing there. */
  val question = Decoupled(new RoomQuestion(config))
  val met      = Flipped(Valid(Context(config)))
  val nothing  = Flipped(Valid(Context(config)))

  /** A path that need not wait any more. */
  val turn = Decoupled(new PathAside(config))
}
